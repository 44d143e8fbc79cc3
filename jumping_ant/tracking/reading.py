"""The project's files as tracking reads them, also while they are being written."""

import math
from pathlib import Path
from zipfile import BadZipFile

from jumping_ant.base import tables
from jumping_ant.base.archive import Archive, to_array
from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import curves

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


def filmed_seed(root: Path, agent: str) -> int | None:
    """Return the seed whose episode the agent's video shows; None if it has none yet."""
    path = Paths(root).agent(agent).trajectory
    if not path.exists():
        return None
    try:
        with path.open("rb") as file:
            archive = Archive(file)
            shown = str(to_array(archive["agent.npy"]))
            if shown != agent:
                raise ValueError(f"given an episode of agent {shown!r}, allowed: {agent!r}")
            return int(to_array(archive["seed.npy"]))
    except (ValueError, KeyError, OSError, BadZipFile) as error:
        raise InputError(f"{path}: {error}; `dvc repro` recreates it") from error
