"""The tables of training: learning curves, their seconds, and what was returned in validation.

`jumping_ant.training.driver` writes them; whoever reads them does so here.
"""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from jumping_ant.base import tables
from jumping_ant.base.files import blamed
from jumping_ant.base.paths import Paths
from jumping_ant.base.tables import ANY, SECONDS, SEED, Column, Table
from jumping_ant.params.model import Params

Array = NDArray[np.float64]
Unit = Literal["env_steps", "seconds"]

COUNT = Column(low=0, high=1e15, is_whole=True)
COLUMNS = {
    "env_steps": COUNT,
    "updates": replace(COUNT, can_be_empty=True),
    "episodes": replace(COUNT, can_be_empty=True),
    "return_mean": ANY,
    "return_std": ANY,
    "evaluation_return_mean": Column(can_be_empty=True),
    "evaluation_return_std": Column(low=0, can_be_empty=True),
}
"""Columns of a learning curve after those of its owner; each algorithm adds others."""
TIMING_COLUMNS = {"seed": SEED, "env_steps": COUNT, "seconds": SECONDS}
VALIDATION_COLUMNS = {
    "env_steps": COUNT,
    "episodes": Column(low=1, high=1e7, is_whole=True),
    "return_mean": Column(),
    "return_std": Column(low=0),
}
"""Columns after those of the owner; a row for each snapshot that came into question."""


def owner(agent: str, seed: int) -> dict[str, str | int]:
    """Return the first columns of a learning curve: whose it is."""
    return {"agent": agent, "seed": seed}


def read(root: Path, agent: str, seed: int) -> Table:
    """Read a trained seed's learning curve; a row of an evaluation has NaN for the training's."""
    files = Paths(root).agent(agent).seed(seed)
    whose = owner(agent, seed)
    return tables.read(files.curve, f"train@{agent}", whose, COLUMNS, ANY, load=files.content)


def read_all(root: Path, params: Params, agent: str) -> dict[int, Table]:
    """Read each seed's learning curve."""
    return {seed: read(root, agent, seed) for seed in params.seeds}


def read_timed(root: Path, params: Params, agent: str) -> dict[int, Table]:
    """Read each seed's learning curve, with the training `seconds` up to each of its rows."""
    paths, stage = Paths(root).agent(agent), f"train@{agent}"
    timing = tables.read(paths.timing, stage, {"agent": agent}, TIMING_COLUMNS)
    curves, agent_block = read_all(root, params, agent), params.agent(agent)
    with blamed(stage, paths.timing):
        for seed in dict.fromkeys([*curves, *timing["seed"].tolist()]):
            rows = timing["seed"] == seed
            steps = curves[seed]["env_steps"] if seed in curves else np.empty(0)
            if not np.array_equal(timing["env_steps"][rows], steps):
                allowed = f"those of {paths.seed(int(seed)).curve}"
                raise ValueError(f"given other env_steps of seed {seed:.0f}, allowed: {allowed}")
            seconds = curves[seed]["seconds"] = timing["seconds"][rows]
            if (np.diff(seconds) < 0).any() or (seconds[0] == 0 and agent_block.max_env_steps):
                raise ValueError("given seconds that are 0 or shrink, allowed: those of a clock")
    return curves


def published_return(root: Path, agent: str, seed: int) -> float:
    """Return the mean return of a seed's published policy in validation."""
    files, whose = Paths(root).agent(agent).seed(seed), owner(agent, seed)
    kinds, stage = VALIDATION_COLUMNS, f"train@{agent}"
    table = tables.read(files.validation, stage, whose, kinds, load=files.content)
    return float(table["return_mean"].max())


def best_first(root: Path, agent: str, seeds: Iterable[int]) -> list[int]:
    """Return seeds of an agent, the one whose policy did best in validation first."""
    return sorted(seeds, key=lambda seed: -published_return(root, agent, seed))


def evaluations(curve: Table, against: Unit = "env_steps") -> tuple[Array, Array]:
    """Return the control steps or seconds of a learning curve's evaluations, and mean returns."""
    rows = _is_evaluation(curve)
    return curve[against][rows], curve["evaluation_return_mean"][rows]


def onset(curve: Table, threshold: float, unit: Unit) -> tuple[float, float]:
    """Return bounds on the training after which returns exceed a threshold, for good.

    It ends between the last evaluation that does not exceed the threshold (0 if all do) and the
    next one (infinity if there is none).
    """
    trained, returns = evaluations(curve, unit)
    failed = np.flatnonzero(~(returns > threshold))
    first = int(failed[-1]) + 1 if len(failed) else 0
    bounds = np.concatenate([[0.0], trained, [np.inf]])
    return float(bounds[first]), float(bounds[first + 1])


def _is_evaluation(table: Table) -> NDArray[np.bool_]:
    """Return which rows of a learning curve are evaluations, shape (num_rows,)."""
    return np.asarray(~np.isnan(table["evaluation_return_mean"]))
