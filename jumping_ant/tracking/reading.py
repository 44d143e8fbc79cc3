"""The project's files as tracking reads them, also while they are being written."""

import math
from pathlib import Path
from zipfile import BadZipFile

from jumping_ant.base import tables
from jumping_ant.base.archive import Archive, to_array
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
        step = _whole(row.pop("env_steps"), path)
        points |= {(name, step): value for name, value in row.items() if math.isfinite(value)}
    return points


def _whole(number: float, path: Path) -> int:
    if not number.is_integer():  # neither is one that is not finite
        raise InputError(f"{path}: given {number} control steps, allowed: whole numbers")
    return int(number)


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
        content = path.read_bytes()
    except FileNotFoundError:
        return []
    whole_lines = content[: content.rfind(b"\n") + 1]
    try:
        rows = [
            {name: float(cell) for name, cell in row.items() if cell and name not in words}
            for row in tables.parse_rows(whole_lines.decode())
            if all(row[name] == word for name, word in words.items())
        ]
    except (ValueError, KeyError) as error:
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
        with path.open("rb") as file:
            return int(to_array(Archive(file)["seed.npy"]))
    except (ValueError, KeyError, OSError, BadZipFile) as error:
        raise InputError(f"{path}: {error}; `dvc repro` recreates it") from error
