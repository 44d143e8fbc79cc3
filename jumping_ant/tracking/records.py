"""What the project's files say about trained agents, in MLflow's terms but without MLflow."""

import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jumping_ant.agents import catalogue
from jumping_ant.base import tables
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import blamed, read_json
from jumping_ant.base.paths import AgentPaths, Paths
from jumping_ant.base.tables import SEED, Column
from jumping_ant.comparison.results import merged
from jumping_ant.evaluation.episodes import VARIANTS
from jumping_ant.media.style import looks, remark
from jumping_ant.params.model import Params
from jumping_ant.policies import trained_policy
from jumping_ant.sim import trajectory
from jumping_ant.tracking import commits, descriptions
from jumping_ant.training import curves

TRAIN_SECONDS = "train_seconds"
VALIDATION_RETURN = "validation_return"  # of the published policy, which was chosen by it
FINAL_RETURN = "final_return"  # of the policy at the end of training, on the held-out episodes
EVALUATION = "evaluation/"
AGGREGATE = "aggregate"  # tag of a run of all seeds of an agent: the key of its comparison
# Of all seeds of an agent: columns of `results/plots/learning_curves.csv`, by metric.
PARTS = {"iqm": "", "low": "_low", "high": "_high", "worst": "_worst"}  # suffixes of means
CURVES_OVER_SEEDS = {"return_iqm": "return_iqm", "return_low": "low", "return_high": "high"}

Point = tuple[str, int]
"""A metric's name and its step: control steps trained so far, 0 for a metric without steps."""


@dataclass(frozen=True)
class SeedRecord:
    """One trained policy: an agent and a seed."""

    root: Path
    agent: str
    seed: int
    algorithm: str
    params: dict[str, str]  # those worth filtering on
    colour: str  # the agent's in figures
    digest: str  # SHA-256 of the policy file
    commit: str | None  # whose `dvc.lock` holds it, if the project is at one that does

    @property
    def paths(self) -> AgentPaths:
        """The agent's files."""
        return Paths(self.root).agent(self.agent)

    @property
    def name(self) -> str:
        """The name of its run and its model."""
        return run_name(self.agent, self.seed)

    @property
    def policy_path(self) -> Path:
        """The policy file."""
        return self.paths.seed(self.seed).policy

    @property
    def content(self) -> bytes:
        """The content of the policy file."""
        return self.paths.seed(self.seed).content(self.policy_path)

    @cached_property
    def md5(self) -> str:
        """MD5 of the policy file, its key in DVC's cache."""
        return hashlib.md5(self.content, usedforsecurity=False).hexdigest()

    @cached_property
    def hold(self) -> int:
        """Control steps that each output is held for."""
        return trained_policy.load(self.paths.seed(self.seed)).actions.hold

    @cached_property
    def curve(self) -> dict[Point, float]:
        """The learning curve."""
        return read_curve(self.root, self.agent, self.seed)

    @cached_property
    def seconds(self) -> dict[int, float]:
        """Seconds of training by control steps trained, where measured."""
        rows = self._rows(self.paths.timing, stage(self.agent), curves.TIMING_COLUMNS)
        return {int(row["env_steps"]): row["seconds"] for row in rows}

    @cached_property
    def summary(self) -> dict[str, float]:
        """Means over held-out episodes, validation and final return, training time; all finite."""
        means, evaluation = dict[str, float](), f"evaluate@{self.agent}"
        for row in self._rows(self.paths.seed_means, evaluation, {"seed": SEED}):
            means |= {EVALUATION + name: mean for name, mean in row.items() if name != "seed"}
        if self.validation_return is not None:
            means[VALIDATION_RETURN] = self.validation_return
        columns = {"seed": SEED, "variant": Column(words=VARIANTS)}
        for row in self._rows(self.paths.variants, evaluation, columns):
            if row["variant"] == "final":
                means[FINAL_RETURN] = row["return"]
        if self.seconds:
            means[TRAIN_SECONDS] = max(self.seconds.values())
        return {name: mean for name, mean in means.items() if math.isfinite(mean)}

    def _rows(self, path: Path, stage: str, columns: Mapping[str, Column]) -> list[dict[str, Any]]:
        """Return the seed's rows of a table of its agent."""
        table = tables.read_growing(path, stage, {"agent": self.agent}, columns)
        numbers = np.flatnonzero(table.get("seed", np.empty(0)) == self.seed)
        return [{name: column[row].item() for name, column in table.items()} for row in numbers]

    @cached_property
    def validation_return(self) -> float | None:
        """Mean return of the published policy in validation; None if there was none yet."""
        if not self.paths.seed(self.seed).validation.exists():
            return None
        return curves.published_return(self.root, self.agent, self.seed)

    def describe(self) -> str:
        """Return what the policy is, how good it is and where it comes from, as Markdown."""
        means = {name.removeprefix(EVALUATION): mean for name, mean in self.summary.items()}
        origins = {"DVC stage": stage(self.agent), "policy file, SHA-256": self.digest}
        origins["policy file in DVC's cache, MD5"] = self.md5
        aside = remark(catalogue.ALGORITHMS[self.algorithm].is_baseline, self.params["robot"])
        name = f"{self.algorithm} ({aside})" if aside else self.algorithm
        return descriptions.policy(name, self.seed, self.hold, means, origins)

    @cached_property
    def artifacts(self) -> dict[str, Path]:
        """Files of the run, by their path in it; video and recording if they show this seed."""
        trained, shown = self.paths.seed(self.seed), self.paths.trajectory
        files = {path.name: path for path in (trained.policy, trained.curve, self.paths.machines)}
        if shown.exists():
            episode = trajectory.load(shown)
            if episode.agent != self.agent:
                raise InputError(
                    f"{shown}: given an episode of agent {episode.agent!r}, allowed: "
                    f"{self.agent!r}; run `dvc repro --force evaluate@{self.agent}`"
                )
            files |= _media(self.paths) if episode.seed == self.seed else {}
        return _existing(files)


@dataclass(frozen=True)
class ComparisonRecord:
    """All trained policies of `params.yaml` together."""

    root: Path
    seeds: list[SeedRecord]
    missing: list[tuple[str, int]]  # agent and seed of what is not trained with these parameters
    commit: str | None  # whose `dvc.lock` holds the comparison, if the project is at one that does

    @property
    def key(self) -> str:
        """The comparison's identifier: a digest over its policies and their parameters."""
        content = {record.name: [record.digest, record.params] for record in self.seeds}
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    @property
    def agents(self) -> list[str]:
        """The agents that have a trained policy."""
        return list(dict.fromkeys(record.agent for record in self.seeds))

    @cached_property
    def results(self) -> dict[str, Any]:
        """`results/comparison.json` with `results/speed.json`, empty if there is no comparison."""
        paths = Paths(self.root)
        return merged(_json(paths.comparison, "compare"), _json(paths.speed, "timing"))

    def check(self) -> None:
        """Raise an InputError if results hold other values than their stages write."""
        paths = Paths(self.root)
        with blamed("compare timing", paths.comparison, paths.robustness, paths.speed):
            _ = self.note, self.summary, list(map(self.over_seeds, self.compared))
            _ = list(map(self.curve_over_seeds, self.compared))

    @cached_property
    def note(self) -> str:
        """What it shows, as Markdown."""
        return descriptions.comparison(self.results)

    @property
    def compared(self) -> dict[str, int]:
        """The numbers of seeds of the agents that were compared."""
        agents = self.results.get("agents", {})
        return {agent: int(entry["seeds"]) for agent, entry in agents.items()}

    @cached_property
    def summary(self) -> dict[str, float]:
        """The comparison's headline numbers."""
        withstood = _json(Paths(self.root).robustness, "compare")
        return dict(_headlines(self.results)) | dict(_withstood(withstood))

    def over_seeds(self, agent: str) -> dict[str, float]:
        """Return interquartile means over an agent's seeds, as runs of seeds name them."""
        quantities = self.results["agents"][agent]
        means = {
            f"{EVALUATION}{quantity}{PARTS[part]}": number
            for quantity, part, number in _numbers(quantities)
            if part in PARTS and "iqm" in quantities[quantity]
        }
        seconds = quantities.get("wall_seconds")
        return means if seconds is None else means | {TRAIN_SECONDS: float(seconds)}

    def curve_over_seeds(self, agent: str) -> dict[Point, float]:
        """Return an agent's learning curve over its seeds, with its interval; {} without table."""
        path = Paths(self.root).plots / "learning_curves.csv"
        if not path.exists():
            return {}
        with blamed("compare", path):
            columns = ["agent", "env_steps", *CURVES_OVER_SEEDS.values()]
            table = pd.read_csv(path, usecols=columns, dtype={"agent": str}, keep_default_na=False)
        rows = table[table["agent"] == agent]
        return {
            (name, round(step)): value
            for name, column in CURVES_OVER_SEEDS.items()
            for step, value in zip(rows["env_steps"], rows[column], strict=True)
        }

    @cached_property
    def artifacts(self) -> dict[str, Path]:
        """Files of the run, by their path in it."""
        paths = Paths(self.root)
        plain = (paths.params, paths.physique, paths.comparison, paths.speed, paths.robustness)
        files = {path.name: path for path in plain}
        files |= {f"results/{paths.report.name}": paths.report}
        files |= {f"media/{paths.lineup.name}": paths.lineup}
        files |= {f"figures/{path.name}": path for path in sorted(paths.figures.glob("*.*"))}
        for agent in self.agents:
            files |= _media(paths.agent(agent))
        return _existing(files)


def read(root: Path, params: Params) -> ComparisonRecord:
    """Find every policy that was trained with the parameters of a project."""
    paths, records, missing, named = Paths(root), [], [], dict[str, str | None]()
    locked, head = commits.workspace(root), commits.head(root)
    is_built = locked.allows("build")
    looked = looks({name: catalogue.row(block).family for name, block in params.agents.items()})
    for agent, block in params.agents.items():
        fixed = block.algorithm, run_params(root, params, agent), looked[agent].colour
        own = paths.agent(agent)
        is_trained = is_built and locked.allows(stage(agent), own.training)
        written = {
            stage(agent): [own.training],
            f"evaluate@{agent}": [own.seed_means, own.variants],
        }
        named[agent] = head.commit_of(written)
        for seed in params.seeds:
            files = own.seed(seed)
            if is_trained and files.policy.exists():
                sha256 = hashlib.sha256(files.content(files.policy)).hexdigest()
                records.append(SeedRecord(root, agent, seed, *fixed, sha256, named[agent]))
            else:
                missing.append((agent, seed))
    written = {"compare": [paths.comparison, paths.robustness]}
    written |= {"timing": [paths.speed], "report": [paths.report]}
    commit = head.commit_of(written) if all(named.values()) else None
    return ComparisonRecord(root, records, missing, commit)


def read_curve(root: Path, agent: str, seed: int) -> dict[Point, float]:
    """Read a learning curve, also one in the making, without empty cells; {} if it has no file."""
    path = Paths(root).agent(agent).seed(seed).curve
    owner, steps = curves.owner(agent, seed), {"env_steps": curves.COUNT}
    table = tables.read_growing(path, stage(agent), owner, steps)
    return {
        (name, int(step)): float(column[row])
        for row, step in enumerate(table.pop("env_steps", ()))
        for name, column in table.items()
        if math.isfinite(column[row])
    }


def run_name(agent: str, seed: int) -> str:
    """Return the name of the run of an agent and a seed."""
    return f"{agent}-seed-{seed}"


def stage(agent: str) -> str:
    """Return the stage of the pipeline that trains an agent."""
    return f"train@{agent}"


def run_params(root: Path, params: Params, agent: str) -> dict[str, str]:
    """Return what runs are filtered by: the agent's block, the task, the robot and its physique."""
    block = params.agent(agent)
    is_edited = block.robot == "edited"
    physique = _json(Paths(root).physique, "build").get("after" if is_edited else "before", {})
    numbers = {name: value for name, value in physique.items() if isinstance(value, float)}
    # MLflow's parameter names allow no patterns, so the edits are one value.
    edits = params.robot.model_dump() | {"edits": str(params.robot.edits)}
    robot = (edits if is_edited else {"source": params.robot.source}) | numbers
    task = {"env": params.env.model_dump(), "robot": robot}
    return dict(_flatten(block.model_dump())) | dict(_flatten(task))


def _flatten(content: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from _flatten(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", str(value)


def _headlines(results: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """Yield `sac/return_iqm`, `sac/env_steps`, `probability_of_improvement/sac_over_dqn`, ..."""
    for agent, quantities in results.get("agents", {}).items():
        for quantity, part, number in _numbers(quantities):
            yield f"{agent}/{quantity}_{part}".removesuffix("_"), number
    for pair, chance in results.get("probability_of_improvement", {}).items():
        yield f"probability_of_improvement/{pair.replace('>', '_over_')}", float(chance["p"])


def _numbers(quantities: Mapping[str, Any]) -> Iterator[tuple[str, str, float]]:
    """Yield an agent's finite numbers, each with its quantity and its part of it, or ""."""
    for quantity, value in quantities.items():
        for part, number in (value if isinstance(value, Mapping) else {"": value}).items():
            if isinstance(number, int | float) and math.isfinite(number):
                yield quantity, part, float(number)


def _withstood(summary: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """Yield `sac/kept_friction`, at its most severe level, ..."""
    for agent, perturbations in summary.get("agents", {}).items():
        for name, its in perturbations.items():
            if (kept := its["retention"][-1]) is not None:
                yield f"{agent}/kept_{name}", float(kept)


def _media(paths: AgentPaths) -> dict[str, Path]:
    return {f"media/{path.name}": path for path in (paths.film, paths.recording)}


def _json(path: Path, stage: str) -> dict[str, Any]:
    return read_json(path, stage) if path.exists() else {}


def _existing(paths: Mapping[str, Path]) -> dict[str, Path]:
    return {name: path for name, path in paths.items() if path.is_file()}
