"""The project's files as tracking reads them, also while they are being written."""

import csv
import math
from pathlib import Path

import numpy as np

from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths

Point = tuple[str, int]
"""A metric's name and its step: control steps trained so far, 0 for a metric without steps."""


def read_curve(path: Path) -> dict[Point, float]:
    """Read a learning curve, also one that is being written: an unterminated last line is left out.

    Returns:
        Values by column and control steps; empty and non-finite cells are left out. Empty if
        there is no such file.

    Raises:
        InputError: The file is not a learning curve.
    """
    points: dict[Point, float] = {}
    for row in read_rows(path, "env_steps"):
        step = int(row.pop("env_steps"))
        points |= {(name, step): value for name, value in row.items() if math.isfinite(value)}
    return points


def read_rows(path: Path, *needed: str, **words: str) -> list[dict[str, float]]:
    """Read a CSV file of numbers; empty cells are left out, a missing file has no rows.

    Args:
        path: The file.
        needed: Columns without empty cells.
        words: Text columns: rows with a different text are left out, as are these columns.

    Raises:
        InputError: A cell is not a number, or is empty in a required column.
    """
    try:
        text = path.read_text()
    except FileNotFoundError:
        return []
    whole_lines = text[: text.rfind("\n") + 1].splitlines()
    try:
        rows = [
            {name: float(cell) for name, cell in row.items() if cell and name not in words}
            for row in csv.DictReader(whole_lines)
            if all(row[name] == word for name, word in words.items())
        ]
    except (ValueError, TypeError, KeyError) as error:
        raise InputError(f"{path}: {error}; allowed: a table of numbers") from error
    if any(name not in row for row in rows for name in needed):
        raise InputError(f"{path}: a row lacks one of {', '.join(needed)}; train again")
    return rows


def filmed_seed(root: Path, agent: str) -> int | None:
    """Return the seed whose episode the agent's video shows; None if it has none yet.

    Raises:
        InputError: The episode's file is damaged.
    """
    path = Paths(root).agent(agent).trajectory
    if not path.exists():
        return None
    try:
        with np.load(path, allow_pickle=False) as trajectory:
            return int(trajectory["seed"])
    except (ValueError, KeyError, OSError) as error:
        raise InputError(f"{path}: {error}; `dvc repro` recreates it") from error
