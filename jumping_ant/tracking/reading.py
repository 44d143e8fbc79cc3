"""The project's files as tracking reads them, also while they are being written."""

import math
from pathlib import Path

from jumping_ant.base import tables
from jumping_ant.base.paths import Paths
from jumping_ant.training import curves

Point = tuple[str, int]
"""A metric's name and its step: control steps trained so far, 0 for a metric without steps."""


def read_curve(root: Path, agent: str, seed: int) -> dict[Point, float]:
    """Read a learning curve, also one in the making, without empty cells; {} if it has no file."""
    path = Paths(root).agent(agent).seed(seed).curve
    owner, steps = curves.owner(agent, seed), {"env_steps": curves.COUNT}
    table = tables.read_growing(path, f"train@{agent}", owner, steps)
    return {
        (name, int(step)): float(column[row])
        for row, step in enumerate(table.pop("env_steps", ()))
        for name, column in table.items()
        if math.isfinite(column[row])
    }
