"""What the project's files say about trained agents, in the words of MLflow.

Nothing here knows MLflow: a policy file becomes a record with parameters, curve points, summary
metrics and artifacts, and the tracking modules make MLflow say the same.
"""

import csv
import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from jumping_ant.errors import InputError
from jumping_ant.files import digest
from jumping_ant.looks import looks
from jumping_ant.params import Params
from jumping_ant.tracking import descriptions

Point = tuple[str, int]
"""A metric's name and its step: control steps trained so far, 0 for what has no step."""

TRAIN_SECONDS = "train_seconds"
EVALUATION = "evaluation/"
LINEUP = "lineup"  # a recording of all agents side by side
SYSTEM = "system/"  # of the machine while it trained; MLflow gives these a page of their own


@dataclass(frozen=True)
class SeedRecord:
    """One trained policy: an agent and a seed.

    Attributes:
        root: The project folder.
        agent: The agent's name.
        seed: The training seed.
        algorithm: What trained it.
        params: Parameters worth filtering on, by name.
        digest: SHA-256 of the policy file.
        colour: What the agent is drawn in.
    """

    root: Path
    agent: str
    seed: int
    algorithm: str
    params: dict[str, str]
    digest: str
    colour: str

    @property
    def name(self) -> str:
        """What its run and its model are called."""
        return run_name(self.agent, self.seed)

    @property
    def stage(self) -> str:
        """The stage of the pipeline that trained it."""
        return stage(self.agent)

    @property
    def label(self) -> str:
        """How messages name it."""
        return f"{self.agent} seed {self.seed}"

    @property
    def policy_path(self) -> Path:
        """The policy file."""
        return seed_dir(self.root, self.agent, self.seed) / "policy.zip"

    @cached_property
    def md5(self) -> str:
        """MD5 of the policy file, by which DVC's cache has it."""
        return hashlib.md5(self.policy_path.read_bytes(), usedforsecurity=False).hexdigest()

    @cached_property
    def curve(self) -> dict[Point, float]:
        """The learning curve."""
        return read_curve(self.policy_path.with_name("curve.csv"))

    @cached_property
    def seconds(self) -> dict[int, float]:
        """Seconds of training by control steps trained, as far as they were measured."""
        path = self.root / "results" / "timing" / f"{self.agent}.csv"
        rows = _rows(path, "seed", "env_steps", "seconds")
        return {int(row["env_steps"]): row["seconds"] for row in rows if row["seed"] == self.seed}

    @cached_property
    def summary(self) -> dict[Point, float]:
        """Means over the seed's evaluation episodes, and the seconds its training took."""
        means: dict[Point, float] = {}
        for row in _rows(self.root / "results" / "seeds" / f"{self.agent}.csv", "seed"):
            if row.pop("seed") == self.seed:
                means |= {(EVALUATION + name, 0): mean for name, mean in row.items()}
        if self.seconds:
            means[TRAIN_SECONDS, 0] = max(self.seconds.values())
        return {point: mean for point, mean in means.items() if math.isfinite(mean)}

    def describe(self, commit: str | None) -> str:
        """Return what the policy is, how good and from where, as Markdown.

        Args:
            commit: The git commit that it was trained at, if that is known.
        """
        means = {
            name.removeprefix(EVALUATION): mean
            for (name, _), mean in self.summary.items()
            if name.startswith(EVALUATION)
        }
        origins = {
            "DVC stage": self.stage,
            "git commit": commit,
            "policy file, SHA-256": self.digest,
            "policy file in DVC's cache, MD5": self.md5,
        }
        known = {what: value for what, value in origins.items() if value}
        return descriptions.policy(self.algorithm, self.seed, means, known)

    @cached_property
    def artifacts(self) -> dict[str, Path]:
        """Files of the run, by their path in it; video and recording if they show this seed."""
        names = (self.policy_path.name, "curve.csv", "machine.json")
        found = {name: self.policy_path.with_name(name) for name in names}
        if _filmed_seed(self.root, self.agent) == self.seed:
            found |= _media(self.root, self.agent)
        return _existing(found)


@dataclass(frozen=True)
class ComparisonRecord:
    """All trained policies of `params.yaml` together.

    Attributes:
        root: The project folder.
        seeds: Every policy that is trained.
        missing: The agent and seed of every policy that is not.
    """

    root: Path
    seeds: list[SeedRecord]
    missing: list[tuple[str, int]]

    @property
    def key(self) -> str:
        """What identifies the comparison: a digest over its policies."""
        lines = sorted(f"{record.agent}/{record.seed} {record.digest}\n" for record in self.seeds)
        return hashlib.sha256("".join(lines).encode()).hexdigest()

    @property
    def agents(self) -> list[str]:
        """The agents that have a trained policy."""
        return list(dict.fromkeys(record.agent for record in self.seeds))

    @property
    def missing_label(self) -> str:
        """How messages name what is not trained: `sac seeds 0, 1; pgpe seeds 1`."""
        seeds: dict[str, list[str]] = {}
        for agent, seed in self.missing:
            seeds.setdefault(agent, []).append(str(seed))
        return "; ".join(f"{agent} seeds {', '.join(own)}" for agent, own in seeds.items())

    @cached_property
    def results(self) -> dict[str, Any]:
        """`results/comparison.json`, empty if it is not there."""
        path = self.root / "results" / "comparison.json"
        return _read_json(path) if path.exists() else {}

    @cached_property
    def summary(self) -> dict[Point, float]:
        """The comparison's headline numbers."""
        return {(name, 0): value for name, value in _headlines(self.results)}

    @property
    def note(self) -> str:
        """The comparison's results and claims as Markdown."""
        return descriptions.comparison(self.results)

    @cached_property
    def artifacts(self) -> dict[str, Path]:
        """Files of the run, by their path in it."""
        figures = sorted((self.root / "results" / "figures").glob("*.*"))
        found = {
            "params.yaml": self.root / "params.yaml",
            "jumping_ant.json": self.root / "assets" / "jumping_ant.json",
            "comparison.json": self.root / "results" / "comparison.json",
            "results/report.html": self.root / "results" / "report.html",
        }
        found |= {f"figures/{path.name}": path for path in figures}
        for agent in [*self.agents, LINEUP]:
            found |= _media(self.root, agent)
        return _existing(found)


def read(root: Path, params: Params) -> ComparisonRecord:
    """Find every trained policy of `params.yaml`.

    Raises:
        InputError: A file is there but damaged.
    """
    found, missing = [], []
    looked = looks({name: block.algorithm for name, block in params.agents.items()})
    for agent in params.agents:
        settings = run_params(root, params, agent)
        for seed in params.seeds:
            path = seed_dir(root, agent, seed) / "policy.zip"
            try:
                content_digest = digest(path)
            except FileNotFoundError:
                missing.append((agent, seed))
                continue
            algorithm = params.agent(agent).algorithm
            colour = looked[agent].colour
            found.append(SeedRecord(root, agent, seed, algorithm, settings, content_digest, colour))
    return ComparisonRecord(root, found, missing)


def run_name(agent: str, seed: int) -> str:
    """Return what the run of an agent and a seed is called."""
    return f"{agent}-seed-{seed}"


def stage(agent: str) -> str:
    """Return the stage of the pipeline that trains an agent."""
    return f"train@{agent}"


def is_of_curve(metric: str) -> bool:
    """Tell whether a run's metric is a column of its learning curve."""
    return metric != TRAIN_SECONDS and not metric.startswith((EVALUATION, SYSTEM))


def seed_dir(root: Path, agent: str, seed: int) -> Path:
    """Return the folder of a policy and its curve."""
    return root / "models" / agent / f"seed-{seed}"


def run_params(root: Path, params: Params, agent: str) -> dict[str, str]:
    """Return what a run is filtered on: the agent's block, the task, the robot and its physique."""
    physique_path = root / "assets" / "jumping_ant.json"
    physique = _read_json(physique_path).get("after", {}) if physique_path.exists() else {}
    numbers = {name: value for name, value in physique.items() if isinstance(value, float)}
    content = {
        **params.agent(agent).model_dump(),
        "env": params.env.model_dump(),
        "robot": params.robot.model_dump() | numbers,
    }
    return dict(_flatten(content))


def read_curve(path: Path) -> dict[Point, float]:
    """Read a learning curve, also one that is being written: a last line without end is left out.

    Returns:
        Values by column and control steps; empty and non-finite cells are left out. Nothing if
        there is no such file.

    Raises:
        InputError: The file is not a learning curve.
    """
    points: dict[Point, float] = {}
    for row in _rows(path, "env_steps"):
        step = int(row.pop("env_steps"))
        points |= {(name, step): value for name, value in row.items() if math.isfinite(value)}
    return points


def _rows(path: Path, *needed: str) -> list[dict[str, float]]:
    """Read a CSV file of numbers; empty cells are left out, a missing file has no rows.

    Raises:
        InputError: A cell is not a number, or empty in a column that is needed.
    """
    try:
        text = path.read_text()
    except FileNotFoundError:
        return []
    whole_lines = text[: text.rfind("\n") + 1].splitlines()
    try:
        rows = [
            {name: float(cell) for name, cell in row.items() if cell}
            for row in csv.DictReader(whole_lines)
        ]
    except (ValueError, TypeError) as error:
        raise InputError(f"{path}: {error}; allowed: a table of numbers") from error
    if any(name not in row for row in rows for name in needed):
        raise InputError(f"{path}: a row lacks one of {', '.join(needed)}; train again")
    return rows


def _read_json(path: Path) -> dict[str, Any]:
    try:
        content: dict[str, Any] = json.loads(path.read_text())
    except ValueError as error:
        raise InputError(f"{path}: not JSON: {error}; `dvc repro` writes it anew") from error
    return content


def _flatten(content: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from _flatten(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", str(value)


def _headlines(results: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """Yield `sac/return_iqm`, `sac/env_steps`, `probability_of_improvement/sac_over_dqn`, ..."""
    for agent, quantities in results.get("agents", {}).items():
        for quantity, value in quantities.items():
            parts = value if isinstance(value, Mapping) else {"": value}
            for part, number in parts.items():
                if isinstance(number, int | float):
                    yield f"{agent}/{quantity}_{part}".removesuffix("_"), float(number)
    for pair, chance in results.get("probability_of_improvement", {}).items():
        yield f"probability_of_improvement/{pair.replace('>', '_over_')}", float(chance["p"])


def _filmed_seed(root: Path, agent: str) -> int | None:
    """Return the seed whose episode the agent's video shows."""
    path = root / "results" / agent / "trajectories.npz"
    if not path.exists():
        return None
    try:
        with np.load(path, allow_pickle=False) as trajectory:
            return int(trajectory["seed"])
    except (ValueError, KeyError, OSError) as error:
        raise InputError(f"{path}: {error}; `dvc repro` writes it anew") from error


def _media(root: Path, agent: str) -> dict[str, Path]:
    names = (f"{agent}.mp4", f"{agent}.rrd")
    return {f"media/{name}": root / "media" / name for name in names}


def _existing(paths: Mapping[str, Path]) -> dict[str, Path]:
    return {name: path for name, path in paths.items() if path.is_file()}
