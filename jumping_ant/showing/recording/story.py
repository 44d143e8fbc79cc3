"""What a recording shows about its agent and episode besides the episode itself."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from jumping_ant.agents import catalogue
from jumping_ant.base import tables
from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.experiment.models import Params
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.words import looks
from jumping_ant.words.looks import Family

Array = NDArray[np.float64]

MEASURES = ("return", "peak_height", "jumps", "airborne_seconds")
_CURVE_COLUMNS = ("env_steps", "evaluation_return_mean")


@dataclass(frozen=True)
class Story:
    """An agent and one of its episodes.

    Attributes:
        agent: The agent's name.
        algorithm: The algorithm it runs.
        family: The algorithm's family.
        robot: Which robot it moves, `edited` or `unedited`.
        measures: The episode's `MEASURES` (see `jumping_ant.judging.evaluation`).
        mean_return: Mean over all the agent's held-out episodes.
        curves: Each seed's learning curve: the control steps at which its policy was evaluated,
            and the returns there, both of shape (num_evaluations,).
    """

    agent: str
    algorithm: str
    family: Family
    robot: str
    measures: Mapping[str, float]
    mean_return: float
    curves: Mapping[int, tuple[Array, Array]]

    @property
    def is_baseline(self) -> bool:
        """Return whether the agent learns nothing."""
        return self.family == looks.BASELINE

    @property
    def label(self) -> str:
        """Return the agent's display name."""
        return looks.label(self.agent, self.algorithm, self.is_baseline)


def read(root: Path, params: Params, agent: str, trajectory: Trajectory) -> Story:
    """Read what is known about an episode.

    Args:
        root: The project folder.
        params: Its parameters.
        agent: The agent.
        trajectory: Its episode.

    Raises:
        InputError: A file is missing or malformed, or does not hold the episode.
    """
    block = params.agent(agent)
    path, stage = Paths(root).agent(agent).episodes, f"evaluate@{agent}"
    table = tables.read(path, ("seed", "episode", *MEASURES), stage)
    (own,) = np.nonzero(
        (table["seed"] == trajectory.seed) & (table["episode"] == trajectory.episode)
    )
    if len(own) != 1:
        raise InputError(
            f"{path}: holds {len(own)} rows of seed {trajectory.seed}, episode "
            f"{trajectory.episode}, which is recorded; run `dvc repro --force {stage}`"
        )
    return Story(
        agent=agent,
        algorithm=block.algorithm,
        family=catalogue.row(block).family,
        robot=block.robot,
        measures={name: float(table[name][own[0]]) for name in MEASURES},
        mean_return=float(table["return"].mean()),
        curves={seed: _read_curve(root, agent, seed) for seed in params.seeds},
    )


def _read_curve(root: Path, agent: str, seed: int) -> tuple[Array, Array]:
    path = Paths(root).agent(agent).seed(seed).curve
    table = tables.read(path, _CURVE_COLUMNS, f"train@{agent}")
    steps, returns = (table[name] for name in _CURVE_COLUMNS)
    evaluated = np.isfinite(returns)
    return steps[evaluated], returns[evaluated]
