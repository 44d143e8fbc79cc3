"""Read CSV files that stages have written."""

import csv
from collections.abc import Container, Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from jumping_ant.base.errors import InputError


def read(
    path: Path, columns: Iterable[str], stage: str, text: Container[str] = ()
) -> dict[str, NDArray[np.float64]]:
    """Read a CSV file of numbers by column; an empty cell is NaN.

    Args:
        path: The file.
        columns: Columns that the file must have; others are read too.
        stage: The stage that writes it, for the messages.
        text: Columns of text, which are left out.

    Returns:
        The columns of numbers, each of shape (num_rows,).

    Raises:
        InputError: The file is missing, empty or malformed; the message says what to run.
    """
    rows = read_rows(path, stage)
    found = list(rows[0]) if rows else []
    missing = [column for column in columns if column not in found]
    if missing:
        raise InputError(
            f"{path}: {'no column ' + ', '.join(missing) if rows else 'no rows in it'}; "
            f"run `dvc repro --force {stage}`"
        )
    try:
        return {
            name: np.array([float(row[name] or "nan") for row in rows])
            for name in found
            if name not in text
        }
    except (TypeError, ValueError) as error:
        raise InputError(f"{path}: {error}; run `dvc repro --force {stage}`") from error


def read_rows(path: Path, stage: str) -> list[dict[str, str]]:
    """Read a CSV file as rows of text.

    Args:
        path: The file.
        stage: The stage that writes it, for the message.

    Raises:
        InputError: The file is missing.
    """
    try:
        return list(csv.DictReader(path.read_text().splitlines()))
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; run `dvc repro {stage}`") from error
