"""A project folder in miniature: the files that `compare` reads, with numbers that tests choose."""

import csv
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import small_agents

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.base import tables
from jumping_ant.base.files import PROJECT_ROOT, write_json, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.evaluation import episodes as held_out
from jumping_ant.evaluation import perturbed
from jumping_ant.params import article, params_file
from jumping_ant.params.blocks import CompareParams, EvaluateParams
from jumping_ant.params.model import Params
from jumping_ant.sim import levels
from jumping_ant.sim.perturbations import Condition
from jumping_ant.sim.trajectory import Trajectory

COMPARE = CompareParams(bootstrap_samples=500, margin=10)
LEVELS = {"random": 330.0, "open_loop": 500.0, "dqn": 700.0, "sac": 3000.0, "pgpe": 5000.0}
BUDGETS = {"random": 0, "open_loop": 400, "dqn": 1000, "sac": 200, "pgpe": 8000}
EPISODES = 3
EVALUATE = EvaluateParams(episodes=EPISODES, baseline_episodes=EPISODES, seed=1000000)
MACHINE = {"cpu": "a", "system": "b", "versions": {"torch": "1"}}  # that all trained on


def make_params(agents: Mapping[str, str], seeds: Sequence[int]) -> Params:
    """Return params of agents (name to algorithm) and seeds, the rest as in `write_project`."""
    known = params_file.load()
    return known.model_copy(
        update={
            "seeds": list(seeds),
            "env": article.ENV,
            "agents": {name: block(algorithm) for name, algorithm in agents.items()},
            "compare": COMPARE,
            "evaluate": EVALUATE,
            "training": known.training.model_copy(update={"evaluation_episodes": 2}),
        }
    )


def block(algorithm: str) -> AgentBlock:
    """Return the block of an agent with the budget of `BUDGETS`."""
    agent = small_agents.agents()[algorithm]
    has_steps = hasattr(agent, "total_steps") and algorithm in BUDGETS
    budget = {"total_steps": BUDGETS[algorithm]} if has_steps else {}
    return type(agent).model_validate(agent.model_dump() | budget)


def write_project(root: Path, agents: Mapping[str, str], seeds: Sequence[int]) -> None:
    """Copy claims, and write episodes, variants, curves, timing and machines of every agent.

    Seed number i returns its algorithm's level plus 10 * i, in each episode up to a spread of
    symmetric noise, and reaches it half way through its budget; in variants, 7 less.
    """
    for name in ("claims", "presets"):
        shutil.copytree(PROJECT_ROOT / name, root / name, dirs_exist_ok=True)
    for name, algorithm in agents.items():
        paths, episodes, timing = Paths(root).agent(name), [], []
        for i, seed in enumerate(seeds):
            level = LEVELS[algorithm] + 10 * i
            for episode in range(EPISODES):
                noise = 5 * (episode - (EPISODES - 1) / 2)
                episodes.append(episode_row(name, seed, episode, level + noise))
            curve = curve_rows(BUDGETS[algorithm], level)
            write_curve(root, name, seed, curve)
            timing += timing_rows(name, seed, curve)
        write_csv(paths.episodes, episodes)
        write_csv(paths.timing, timing)
        write_json(paths.machines, {str(seed): MACHINE for seed in seeds})
        variants = [
            {"agent": name, "seed": seed, "variant": variant, "episodes": EPISODES}
            | measures(LEVELS[algorithm] + 10 * i)
            | {"return": LEVELS[algorithm] + 10 * i - 7}
            for i, seed in enumerate(seeds)
            for variant in held_out.variant_names(block(algorithm))
        ]
        write_csv(paths.variants, variants)


def play_only(monkeypatch: pytest.MonkeyPatch, **values: Sequence[float]) -> None:
    """Leave of all perturbations these levels."""
    for name, row in levels.LEVELS.items():
        monkeypatch.setitem(levels.LEVELS, name, row._replace(values=tuple(values.get(name, ()))))


def write_perturbed(
    root: Path, params: Params, kept: Callable[[str, Condition, int], float]
) -> None:
    """Write perturbed episodes: a share, by agent, condition and number of the seed, of 1,000."""
    for name in params.agents:
        returns = {
            case: 1000 * kept(name, case.condition, params.seeds.index(case.seed))
            for case in perturbed.cases(params, name)
        }
        write_text(Paths(root).perturbed(name), perturbed.to_csv(name, returns))


def write_curve(root: Path, agent: str, seed: int, rows: Sequence[Mapping[str, Any]]) -> None:
    path = Paths(root).agent(agent).seed(seed).curve
    write_csv(path, [{"agent": agent, "seed": seed, **row} for row in rows])


def timing_rows(
    agent: str, seed: int, curve: Sequence[Mapping[str, Any]], pace: float = 0.5
) -> list[dict[str, Any]]:
    """Return a seed's rows of `timing.csv`: so many seconds for each control step."""
    return [
        {"agent": agent, "seed": seed, "env_steps": steps, "seconds": steps * pace}
        for steps in (row["env_steps"] for row in curve)
    ]


def shown(root: Path, agent: str, trajectory: Trajectory) -> Trajectory:
    """Return a trajectory as an agent's first episode, whose row gets its length."""
    path = Paths(root).agent(agent).episodes
    first, *others = read_csv(path)
    write_csv(path, [first | {"length": len(trajectory.torques)}, *others])
    return replace(
        trajectory,
        agent=agent,
        seed=int(first["seed"]),
        episode=int(first["episode"]),
        episode_return=float(first["return"]),
    )


def episode_row(agent: str, seed: int, episode: int, value: float) -> dict[str, Any]:
    episode_seed = EVALUATE.block(seed).start + episode
    ids = {"agent": agent, "seed": seed, "episode": episode, "episode_seed": episode_seed}
    return ids | measures(value)


def measures(value: float) -> dict[str, Any]:
    return {
        "length": 1000,
        "return": value,
        "peak_height": value / 1000,
        "apex": value / 1100,
        "mean_height": 0.8,
        "jumps": 12,
        "airborne_seconds": 6.5,
        "flight": 0.13,
        "torque_change": 1 / value,
        "fluidity": -1000 / value,
        "work": 2 * value,
        "drift": 1.5,
        "survived": 1,
    }


def curve_rows(budget: int, level: float) -> list[dict[str, Any]]:
    """Return the rows of a `curve.csv`: every second one holds an evaluation, and the last."""
    means = {budget * i // 8: "" if i % 2 else min(level, level * i / 4) for i in range(1, 9)}
    return [
        {
            "env_steps": steps,
            "updates": steps // 2,
            "episodes": steps // 100,
            "return_mean": "",
            "return_std": "",
            "evaluation_return_mean": mean,
            "evaluation_return_std": "" if mean == "" else 3.0,
            "loss": 0.25,
        }
        for steps, mean in (means.items() if budget else [(0, level)])
    ]


def read_csv(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))


def write_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    write_text(path, tables.to_csv(rows))
