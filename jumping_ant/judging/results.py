"""The measurements of every agent, read from the project folder.

The sample of every statistic is one number per seed; `jumping_ant.judging.comparison` and
`jumping_ant.judging.claims` compute the statistics.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from jumping_ant.agents import catalogue
from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.base import tables
from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.experiment.models import Params
from jumping_ant.words import looks
from jumping_ant.words.looks import Family
from jumping_ant.words.measures import MEASURES

Array = NDArray[np.float64]

KEYS = ("seed", "episode", "episode_seed")  # columns of episodes.csv that are not measurements
QUANTITIES = ("return", "peak_height", "torque_change")  # first in a summary
REQUIRED = ("seed", *QUANTITIES, "flight", "apex", "fluidity")
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

    def sustained(self, threshold: float) -> int | None:
        """Return the row of the first evaluation from which all exceed a threshold, if any."""
        rows = np.flatnonzero(~np.isnan(self.evaluation_return))
        failed = np.flatnonzero(~(self.evaluation_return[rows] > threshold))
        first = failed[-1] + 1 if len(failed) else 0
        return int(rows[first]) if first < len(rows) else None

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
        block: Its block of `params.yaml`.
        quantities: Mean over each seed's episodes, by column of `episodes.csv`, (num_seeds,); NaN
            where a seed has no episode with a value (see `Measure.can_be_empty`).
        curves: Each seed's training, in the same order of seeds.
        episode_returns: Return of every held-out episode of every seed, (num_episodes,).
        variants: The same means for variants of each seed's policy, by variant and column.
        demonstrator: Name of the agent that it imitates; empty if it imitates none.
        step_seconds: Time of a unit of training for each seed [s], (num_seeds,), by number of
            threads; empty for agents that do not train.
    """

    name: str
    block: AgentBlock
    quantities: dict[str, Array]
    curves: dict[int, SeedCurve]
    episode_returns: Array = field(default_factory=lambda: np.empty(0))
    variants: dict[str, dict[str, Array]] = field(default_factory=dict)
    demonstrator: str = ""
    step_seconds: dict[int, Array] = field(default_factory=dict)

    @property
    def algorithm(self) -> str:
        """Return the agent's algorithm."""
        return self.block.algorithm

    @property
    def is_baseline(self) -> bool:
        """Return whether the agent learns nothing."""
        return self.block.is_baseline

    @property
    def family(self) -> Family:
        """Return the family of the agent's algorithm."""
        return catalogue.row(self.block).family

    @property
    def label(self) -> str:
        """Return the agent's display name."""
        return looks.label(self.name, self.algorithm, self.is_baseline)

    @property
    def env_steps(self) -> Array:
        """Return each seed's training budget [control steps], (num_seeds,)."""
        return np.array([curve.env_steps[-1] for curve in self.curves.values()])

    @property
    def train_seconds(self) -> Array:
        """Return each seed's training time [s], (num_seeds,)."""
        return np.array([curve.seconds[-1] for curve in self.curves.values()])


def load(root: Path, params: Params) -> dict[str, AgentResults]:
    """Read the results of all agents, in the order of `params.yaml`.

    Args:
        root: The project folder.
        params: Its parameters: `agents` and `seeds` determine which results must exist.

    Raises:
        InputError: A file is missing, malformed, or has other seeds; the message says what to run.
    """
    results = {}
    for name, block in params.agents.items():
        episodes = read_episodes(root, name, params.seeds)
        results[name] = AgentResults(
            name=name,
            block=block,
            quantities=_seed_means(episodes, params.seeds),
            curves=_read_curves(root, name, params.seeds),
            episode_returns=episodes["return"],
            variants=_read_variants(root, name, params.seeds),
            demonstrator=params.demonstrator(block),
            step_seconds=_read_scaling(root, name, params.seeds),
        )
    return results


def read_episodes(root: Path, agent: str, seeds: Sequence[int]) -> dict[str, Array]:
    """Read an agent's held-out episodes.

    Args:
        root: The project folder.
        agent: The agent's name.
        seeds: Seeds that the file must have.

    Returns:
        The columns of its `episodes.csv`, (num_episodes,) each. NaN stands for the empty cells that
        `Measure.can_be_empty` allows.

    Raises:
        InputError: The file is missing, malformed, or has other seeds.
    """
    path, stage = Paths(root).agent(agent).episodes, f"evaluate@{agent}"
    table = tables.read(path, REQUIRED, stage)
    _check_seeds(path, table["seed"], seeds, stage)
    for name, column in table.items():
        allowed = np.isnan(column) if _can_be_empty(name) else False
        if not (np.isfinite(column) | allowed).all():
            raise InputError(
                f"{path}: column {name} holds a cell that is empty or not finite; "
                f"run `dvc repro --force {stage}`"
            )
    return table


def _seed_means(table: Mapping[str, Array], seeds: Sequence[int]) -> dict[str, Array]:
    """Return each quantity's mean over the episodes of each seed, ignoring empty cells."""
    others = (name for name in table if name not in KEYS + QUANTITIES)
    return {
        name: np.array([_mean(table[name][table["seed"] == seed]) for seed in seeds])
        for name in (*QUANTITIES, *others)
    }


def _read_variants(root: Path, agent: str, seeds: Sequence[int]) -> dict[str, dict[str, Array]]:
    """Return the quantities of each variant of the policies, in the format of the policies'."""
    path, stage = Paths(root).agent(agent).variants, f"evaluate@{agent}"
    rows = tables.read_rows(path, stage)
    if not rows:
        return {}
    table = tables.read(path, REQUIRED, stage, text=("variant",))
    names = np.array([row["variant"] for row in rows])
    variants = {}
    for variant in dict.fromkeys(names.tolist()):
        own = {name: column[names == variant] for name, column in table.items()}
        _check_seeds(path, own["seed"], seeds, stage)
        variants[variant] = _seed_means(own, seeds)
    return variants


def _can_be_empty(column: str) -> bool:
    return column in MEASURES and MEASURES[column].can_be_empty


def _mean(values: Array) -> float:
    """Return the mean of the values that are not NaN, or NaN if all are."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else float("nan")


def _read_curves(root: Path, agent: str, seeds: Sequence[int]) -> dict[int, SeedCurve]:
    """Return each seed's curve, with the seconds of its rows."""
    stage = f"train@{agent}"
    paths = Paths(root).agent(agent)
    timing_path = paths.timing
    timing = tables.read(timing_path, TIMING_COLUMNS, stage)
    _check_seeds(timing_path, timing["seed"], seeds, stage)
    curves = {}
    for seed in seeds:
        path = paths.seed(seed).curve
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
    """Return the seconds of each seed's unit of training by number of threads."""
    path, stage = Paths(root).agent(agent).scaling, f"scaling@{agent}"
    if not tables.read_rows(path, stage):
        return {}
    table = tables.read(path, SCALING_COLUMNS, stage)
    _check_seeds(path, table["seed"], seeds, stage)
    return {
        int(threads): table["seconds"][table["threads"] == threads]
        for threads in np.unique(table["threads"])
    }


def _check_seeds(path: Path, found: Array, seeds: Sequence[int], stage: str) -> None:
    """Raise an error if the seeds are not those of `params.yaml`."""
    held = sorted(set(found.tolist()))
    if held != sorted(seeds):
        raise InputError(
            f"{path}: holds the seeds {', '.join(f'{seed:g}' for seed in held)}, but params.yaml "
            f"names {', '.join(map(str, sorted(seeds)))}; run `dvc repro {stage}`"
        )
