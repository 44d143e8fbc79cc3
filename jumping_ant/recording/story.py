"""What a recording shows about its agent and episode besides the episode itself."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from jumping_ant.agents import catalogue
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import curves, episodes
from jumping_ant.experiment.models import Params
from jumping_ant.looks.naming import BASELINE, Family
from jumping_ant.sim.trajectory import Trajectory

Array = NDArray[np.float64]

MEASURES = ("return", "peak_height", "jumps", "airborne_seconds")


@dataclass(frozen=True)
class Story:
    """An agent and one of its episodes."""

    agent: str
    algorithm: str
    family: Family
    robot: str  # `edited` or `unedited`
    measures: Mapping[str, float]  # the episode's `MEASURES`
    mean_return: float  # over all of the agent's held-out episodes
    curves: Mapping[int, tuple[Array, Array]]  # control steps and returns of evaluations, by seed

    @property
    def is_baseline(self) -> bool:
        """Return whether the agent learns nothing."""
        return self.family == BASELINE

    @property
    def label(self) -> str:
        """Return the agent's display name."""
        return catalogue.label(self.agent, self.algorithm)


def read(root: Path, params: Params, agent: str, trajectory: Trajectory) -> Story:
    """Read what is known about an episode."""
    block = params.agent(agent)
    table = episodes.read(root, params, agent)
    shown = episodes.find(table, agent, trajectory, Paths(root).agent(agent).trajectory)
    return Story(
        agent=agent,
        algorithm=block.algorithm,
        family=catalogue.row(block).family,
        robot=block.robot,
        measures={name: shown[name] for name in MEASURES},
        mean_return=float(table["return"].mean()),
        curves={
            seed: curves.evaluations(curves.read(root, params, agent, seed))
            for seed in params.seeds
        },
    )
