"""The agents side by side: results read from the project folder, and what they say together.

`load` reads every agent's episodes, learning curves and timing; `summarize`, `learning_curves` and
`seed_rows` turn them into the numbers of `results/comparison.json` and `results/plots/`. The
statistics are those of `jumping_ant.statistics`: the sample is the seed.
"""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant import looks, tables
from jumping_ant.errors import InputError
from jumping_ant.measures import MEASURES
from jumping_ant.params import CompareParams, Params
from jumping_ant.statistics import (
    Estimate,
    aggregate_curves,
    common_grid,
    estimate,
    interquartile_mean,
    probability_of_improvement,
)

Array = NDArray[np.float64]

KEYS = ("seed", "episode", "episode_seed")  # columns of episodes.csv that measure nothing
QUANTITIES = ("return", "peak_height", "smoothness")  # always there, and first
CURVE_COLUMNS = ("env_steps", "evaluation_return_mean")
TIMING_COLUMNS = ("seed", "env_steps", "seconds")
SCALING_COLUMNS = ("seed", "threads", "seconds")


@dataclass(frozen=True)
class SeedCurve:
    """One seed's training, row by row, all arrays of shape (num_rows,).

    Attributes:
        env_steps: Control steps simulated so far.
        seconds: Training seconds so far.
        evaluation_return: Mean return of the policy at that point, NaN where it was not evaluated.
    """

    env_steps: Array
    seconds: Array
    evaluation_return: Array

    @property
    def evaluations(self) -> tuple[Array, Array]:
        """Return the steps at which the policy was evaluated, and its returns there."""
        done = ~np.isnan(self.evaluation_return)
        return self.env_steps[done], self.evaluation_return[done]


@dataclass(frozen=True)
class AgentResults:
    """Everything measured of one agent.

    Attributes:
        name: The agent's name in `params.yaml`.
        algorithm: What it runs.
        quantities: Mean over each seed's episodes, by column of `episodes.csv`, (num_seeds,); NaN
            where a seed has no episode with a value (see `Measure.can_be_empty`).
        curves: Each seed's training, in the same order of seeds.
        generation_seconds: By number of threads, what a generation took each seed [s],
            (num_seeds,); nothing for agents without a population.
    """

    name: str
    algorithm: str
    quantities: dict[str, Array]
    curves: dict[int, SeedCurve]
    generation_seconds: dict[int, Array] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """Return the name to print."""
        return looks.label(self.name, self.algorithm)

    @property
    def env_steps(self) -> Array:
        """Return each seed's training budget [control steps], (num_seeds,)."""
        return np.array([curve.env_steps[-1] for curve in self.curves.values()])

    @property
    def train_seconds(self) -> Array:
        """Return each seed's training time [s], (num_seeds,)."""
        return np.array([curve.seconds[-1] for curve in self.curves.values()])


@dataclass(frozen=True)
class LearningCurve:
    """The return an agent's policies reach while they learn, over its seeds.

    Attributes:
        env_steps: Control steps simulated by then, shape (num_points,).
        seconds: Training seconds that took, mean over seeds, (num_points,).
        returns: Interquartile mean over seeds with its interval, arrays of (num_points,).
    """

    env_steps: Array
    seconds: Array
    returns: Estimate


def load(root: Path, params: Params) -> dict[str, AgentResults]:
    """Read the results of all agents, in the order of `params.yaml`.

    Args:
        root: The project folder.
        params: Its parameters: `agents` and `seeds` say what must be there.

    Raises:
        InputError: A file is missing, malformed, or of other seeds; the message says what to run.
    """
    return {
        name: AgentResults(
            name=name,
            algorithm=block.algorithm,
            quantities=_read_quantities(root, name, params.seeds),
            curves=_read_curves(root, name, params.seeds),
            generation_seconds=_read_scaling(root, name, params.seeds),
        )
        for name, block in params.agents.items()
    }


def read_episodes(root: Path, agent: str, seeds: Sequence[int]) -> dict[str, Array]:
    """Read an agent's held-out episodes.

    Args:
        root: The project folder.
        agent: The agent's name.
        seeds: Those that must be there.

    Returns:
        The columns of its `episodes.csv`, (num_episodes,) each. NaN stands for the empty cells that
        `Measure.can_be_empty` allows.

    Raises:
        InputError: The file is missing, malformed, or of other seeds.
    """
    path, stage = root / "results" / agent / "episodes.csv", f"evaluate@{agent}"
    table = tables.read(path, ("seed", *QUANTITIES), stage)
    _check_seeds(path, table["seed"], seeds, stage)
    for name, column in table.items():
        allowed = np.isnan(column) if _can_be_empty(name) else False
        if not (np.isfinite(column) | allowed).all():
            raise InputError(
                f"{path}: column {name} holds a cell that is empty or not finite; "
                f"run `dvc repro --force {stage}`"
            )
    return table


def summarize(results: Mapping[str, AgentResults], params: CompareParams) -> dict[str, Any]:
    """Return the agents' figures and who beats whom, as in `results/comparison.json`.

    Args:
        results: What `load` returns.
        params: Confidence, number of resamples and seed.
    """
    returns = {name: agent.quantities["return"] for name, agent in results.items()}
    pairs = {}
    for one, other in combinations(returns, 2):
        won = probability_of_improvement(returns[one], returns[other], params)
        # The other way round is the same table read from the other side, not another experiment.
        lost = Estimate(1 - won.value, 1 - won.high, 1 - won.low)
        pairs[f"{one}>{other}"] = won.as_dict("p")
        pairs[f"{other}>{one}"] = lost.as_dict("p")
    ordered = (f"{one}>{other}" for one in returns for other in returns if one != other)
    return {
        "agents": {name: _summarize_agent(agent, params) for name, agent in results.items()},
        "probability_of_improvement": {pair: pairs[pair] for pair in ordered},
    }


def learning_curves(
    results: Mapping[str, AgentResults], params: CompareParams
) -> dict[str, LearningCurve]:
    """Return each agent's learning curve over its seeds.

    An agent that trains for no step returns the same at any budget: its curve is level, from the
    first evaluation to the last one among the other agents.
    """
    curves = {name: _learning_curve(agent, params) for name, agent in results.items()}
    learned = [curve for curve in curves.values() if curve.env_steps[-1] > 0]
    if not learned:
        return curves
    starts = min(curve.env_steps[0] for curve in learned), min(c.seconds[0] for c in learned)
    ends = max(curve.env_steps[-1] for curve in learned), max(c.seconds[-1] for c in learned)
    steps, seconds = np.array([starts, ends]).T
    for name, curve in curves.items():
        if curve.env_steps[-1] == 0:
            level = [np.repeat(part[-1], 2) for part in vars(curve.returns).values()]
            curves[name] = LearningCurve(steps, seconds, Estimate(*level))
    return curves


def steps_to(agent: AgentResults, threshold: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return the control steps each seed needed to return more than a threshold, at an evaluation.

    Args:
        agent: The agent.
        threshold: The return.

    Returns:
        Steps to it, or the budget of a seed that never got there, (num_seeds,), and whether it did,
        (num_seeds,).
    """
    steps, reached = [], []
    for curve in agent.curves.values():
        positions, returns = curve.evaluations
        good = returns > threshold
        reached.append(bool(good.any()))
        steps.append(positions[np.argmax(good)] if good.any() else positions[-1])
    return np.array(steps), np.array(reached)


def curve_rows(curves: Mapping[str, LearningCurve]) -> list[dict[str, Any]]:
    """Return the learning curves as a tidy table, one row a point."""
    return [
        {
            "agent": name,
            "env_steps": float(curve.env_steps[i]),
            "seconds": float(curve.seconds[i]),
            "return_iqm": float(curve.returns.value[i]),
            "low": float(curve.returns.low[i]),
            "high": float(curve.returns.high[i]),
        }
        for name, curve in curves.items()
        for i in range(len(curve.env_steps))
    ]


def seed_rows(results: Mapping[str, AgentResults]) -> list[dict[str, Any]]:
    """Return every seed's evaluations as a tidy table, one row an evaluation."""
    return [
        {
            "agent": name,
            "seed": seed,
            "env_steps": int(steps),
            "seconds": float(seconds),
            "evaluation_return": float(value),
        }
        for name, agent in results.items()
        for seed, curve in agent.curves.items()
        for steps, seconds, value in zip(
            curve.env_steps, curve.seconds, curve.evaluation_return, strict=True
        )
        if not np.isnan(value)
    ]


def to_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a table as CSV text; the first row names the columns."""
    text = io.StringIO()
    writer = csv.DictWriter(text, rows[0].keys(), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _summarize_agent(agent: AgentResults, params: CompareParams) -> dict[str, Any]:
    """Return an agent's figures; seeds without a value of a quantity are left out of its estimate.

    A quantity that no seed has is left out altogether.
    """
    known = {name: values[~np.isnan(values)] for name, values in agent.quantities.items()}
    quantities = {
        name: estimate(interquartile_mean, [values], params).as_dict("iqm")
        for name, values in known.items()
        if len(values)
    }
    return {
        "seeds": len(agent.curves),
        **quantities,
        "env_steps": int(agent.env_steps.max()),
        "train_seconds": float(agent.train_seconds.mean()),
    }


def _learning_curve(agent: AgentResults, params: CompareParams) -> LearningCurve:
    evaluations = [curve.evaluations for curve in agent.curves.values()]
    grid = common_grid([steps for steps, _ in evaluations])
    clocks = [np.interp(grid, curve.env_steps, curve.seconds) for curve in agent.curves.values()]
    return LearningCurve(grid, np.mean(clocks, axis=0), aggregate_curves(grid, evaluations, params))


def _read_quantities(root: Path, agent: str, seeds: Sequence[int]) -> dict[str, Array]:
    """Return each quantity's mean over the episodes of each seed, empty cells left out."""
    table = read_episodes(root, agent, seeds)
    others = (name for name in table if name not in KEYS + QUANTITIES)
    return {
        name: np.array([_mean(table[name][table["seed"] == seed]) for seed in seeds])
        for name in (*QUANTITIES, *others)
    }


def _can_be_empty(column: str) -> bool:
    return column in MEASURES and MEASURES[column].can_be_empty


def _mean(values: Array) -> float:
    """Return the mean of the values that are not NaN, NaN where all are."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else float("nan")


def _read_curves(root: Path, agent: str, seeds: Sequence[int]) -> dict[int, SeedCurve]:
    """Return each seed's curve, with the seconds of its rows."""
    stage = f"train@{agent}"
    timing_path = root / "results" / "timing" / f"{agent}.csv"
    timing = tables.read(timing_path, TIMING_COLUMNS, stage)
    _check_seeds(timing_path, timing["seed"], seeds, stage)
    curves = {}
    for seed in seeds:
        path = root / "models" / agent / f"seed-{seed}" / "curve.csv"
        curve = tables.read(path, CURVE_COLUMNS, stage)
        own = timing["seed"] == seed
        if not np.array_equal(timing["env_steps"][own], curve["env_steps"]):
            raise InputError(
                f"{timing_path}: the env_steps of seed {seed} are not those of {path}; "
                f"run `dvc repro --force {stage}`"
            )
        if np.isnan(curve["evaluation_return_mean"]).all():
            raise InputError(f"{path}: no evaluation in it; run `dvc repro --force {stage}`")
        curves[seed] = SeedCurve(
            curve["env_steps"], timing["seconds"][own], curve["evaluation_return_mean"]
        )
    return curves


def _read_scaling(root: Path, agent: str, seeds: Sequence[int]) -> dict[int, Array]:
    """Return the seconds of each seed's generation by number of threads."""
    path, stage = root / "results" / "scaling" / f"{agent}.csv", f"scaling@{agent}"
    if not tables.read_rows(path, stage):
        return {}
    table = tables.read(path, SCALING_COLUMNS, stage)
    _check_seeds(path, table["seed"], seeds, stage)
    return {
        int(threads): table["seconds"][table["threads"] == threads]
        for threads in np.unique(table["threads"])
    }


def _check_seeds(path: Path, found: Array, seeds: Sequence[int], stage: str) -> None:
    """Refuse results of other seeds than those of `params.yaml`."""
    held = sorted(set(found.tolist()))
    if held != sorted(seeds):
        raise InputError(
            f"{path}: holds the seeds {', '.join(f'{seed:g}' for seed in held)}, but params.yaml "
            f"names {', '.join(map(str, sorted(seeds)))}; run `dvc repro {stage}`"
        )
