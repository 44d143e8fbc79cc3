"""Read CSV files that stages have written."""

import csv
from collections.abc import Container, Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import read_bytes


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
    except ValueError as error:
        raise InputError(f"{path}: {error}; run `dvc repro --force {stage}`") from error


def read_rows(path: Path, stage: str) -> list[dict[str, str]]:
    """Read a CSV file as rows of text.

    Args:
        path: The file.
        stage: The stage that writes it, for the message.

    Raises:
        InputError: The file is missing or is not a table; the message says what to run.
    """
    try:
        text = read_bytes(path, stage).decode()
        return parse_rows(text)
    except InputError:
        raise
    except ValueError as error:
        raise InputError(f"{path}: {error}; run `dvc repro --force {stage}`") from error


def parse_rows(text: str) -> list[dict[str, str]]:
    """Read the rows of a CSV file's text.

    Raises:
        ValueError: A row has more or fewer cells than the header, or the text is not CSV.
    """
    try:
        header, *rows = [row for row in csv.reader(text.splitlines()) if row] or [[]]
    except csv.Error as error:
        raise ValueError(str(error)) from error
    if any(len(row) != len(header) for row in rows):
        raise ValueError(f"a row has more or fewer cells than the header's {len(header)}")
    return [dict(zip(header, row, strict=True)) for row in rows]
