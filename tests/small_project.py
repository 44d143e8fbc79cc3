"""A project folder in miniature: the files that `compare` reads, with numbers that tests choose."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.base.files import write_text
from jumping_ant.base.paths import Paths
from jumping_ant.experiment.models import Params
from jumping_ant.params.blocks import CompareParams, TrainingParams

COMPARE = CompareParams(confidence=0.95, power=0.8, bootstrap_samples=500, seed=0)
LEVELS = {"random": 330.0, "open_loop": 500.0, "dqn": 700.0, "sac": 3000.0, "pgpe": 5000.0}
VARIANTS = {"sac": ["final", "rounded"], "pgpe": ["final", "rounded", "best_sample"]}
BUDGETS = {"random": 0, "open_loop": 400, "dqn": 1000, "sac": 200, "pgpe": 8000}


def make_params(agents: Mapping[str, str], seeds: Sequence[int]) -> Params:
    """Return params with what `compare` reads of them: agents (name to algorithm) and seeds."""
    blocks = {
        name: ALGORITHMS[algorithm].settings.model_construct(algorithm=algorithm, robot="edited")
        for name, algorithm in agents.items()
    }
    training = TrainingParams.model_construct(evaluation_episodes=2)
    return Params.model_construct(
        seeds=list(seeds), agents=blocks, compare=COMPARE, training=training
    )


def write_project(
    root: Path, agents: Mapping[str, str], seeds: Sequence[int], num_episodes: int = 3
) -> None:
    """Write the episodes, curves and timing of every agent.

    Seed number i returns its algorithm's level plus 10 * i, in each episode up to a spread of
    symmetric noise, and reaches it half way through its budget.
    """
    for name, algorithm in agents.items():
        episodes, timing = [], []
        for i, seed in enumerate(seeds):
            level = LEVELS[algorithm] + 10 * i
            episodes += [
                episode_row(seed, episode, level + 5 * (episode - (num_episodes - 1) / 2))
                for episode in range(num_episodes)
            ]
            curve = curve_rows(BUDGETS[algorithm], level)
            write_csv(Paths(root).agent(name).seed(seed).curve, curve)
            timing += [
                {"seed": seed, "env_steps": row["env_steps"], "seconds": row["env_steps"] * 0.5}
                for row in curve
            ]
        write_csv(Paths(root).agent(name).episodes, episodes)
        write_csv(Paths(root).agent(name).timing, timing)
        write_variants(root, name, VARIANTS.get(algorithm, []), episodes)
    write_scaling(root, agents, seeds)


def write_variants(
    root: Path, name: str, variants: Sequence[str], episodes: Sequence[Mapping[str, Any]]
) -> None:
    """Write variants of an agent: like its episodes, with 7 less of return."""
    rows = [
        {"seed": row["seed"], "variant": variant, **row, "return": row["return"] - 7}
        for variant in variants
        for row in episodes
    ]
    header = ["seed", "variant", *(name for name in episodes[0] if name != "seed")]
    path = Paths(root).agent(name).variants
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, header)
        writer.writeheader()
        writer.writerows(rows)


def write_scaling(root: Path, agents: Mapping[str, str], seeds: Sequence[int]) -> None:
    """Write what a unit of training took each seed of the agents that learn."""
    for name, algorithm in agents.items():
        lines = [
            f"{seed},{threads},{2.0 / threads + 0.01 * i}"
            for i, seed in enumerate(seeds)
            for threads in (1, 2)
            if algorithm != "random"
        ]
        text = "\n".join(["seed,threads,seconds", *lines]) + "\n"
        write_text(Paths(root).agent(name).scaling, text)


def episode_row(seed: int, episode: int, value: float) -> dict[str, Any]:
    """Return a row of `episodes.csv`."""
    return {
        "seed": seed,
        "episode": episode,
        "episode_seed": 1000000 + episode,
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
    if budget == 0:
        return [curve_row(0, level)]
    rows = []
    for i in range(1, 9):
        rows.append(curve_row(budget * i // 8, "" if i % 2 else min(level, level * i / 4)))
    return rows


def curve_row(env_steps: int, evaluation: float | str) -> dict[str, Any]:
    """Return a row of `curve.csv`, with the columns of an algorithm that has a loss."""
    return {
        "env_steps": env_steps,
        "updates": env_steps // 2,
        "episodes": env_steps // 100,
        "return_mean": "",
        "return_std": "",
        "evaluation_return_mean": evaluation,
        "evaluation_return_std": "" if evaluation == "" else 3.0,
        "loss": 0.25,
    }


def read_csv(path: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV file."""
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))


def write_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows as a CSV file, the first row's keys as header."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)
