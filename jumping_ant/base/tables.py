"""Write CSV files, and read them: whole, of whom they should be, and within their ranges.

The modules of `jumping_ant.experiment` that know a table (`curves`, `episodes`)
describe its columns, and say which rows it has.
"""

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import read_bytes

LARGEST = 1e30  # of what is compared: statistics of such numbers are finite
DECIMAL = re.compile(r"-?(0|[1-9][0-9]*)(\.[0-9]+)?(e[+-][0-9]{2,3})?")  # as Python writes floats
LONGEST = 40  # characters of a cell that a message quotes

Table = dict[str, NDArray[Any]]
"""A table by column, each of shape (num_rows,): numbers, NaN for empty cells, or words."""


@dataclass(frozen=True)
class Column:
    """What a cell may hold: a number in a range, or one of some words.

    Attributes:
        low: The smallest number.
        high: The largest number.
        is_whole: Whether numbers are whole.
        can_be_empty: Whether a cell may be empty instead.
        words: The words, for a column without numbers.
    """

    low: float = -LARGEST
    high: float = LARGEST
    is_whole: bool = False
    can_be_empty: bool = False
    words: tuple[str, ...] = ()

    def parse(self, cell: str) -> float | str:
        """Return a cell's number, NaN if it is empty, or its word.

        Raises:
            ValueError: The cell holds something else; the message says what, and what is allowed.
        """
        if cell in self.words:
            return cell
        if not cell and self.can_be_empty:
            return math.nan
        if not self.words and DECIMAL.fullmatch(cell):
            number = float(cell)
            is_in_range = math.isfinite(number) and self.low <= number <= self.high
            if is_in_range and (number.is_integer() or not self.is_whole):
                return number
        raise ValueError(f"given {cell[:LONGEST]!r}, allowed: {self._allowed}")

    @property
    def _allowed(self) -> str:
        if self.words:
            return ", ".join(self.words)
        kind = "whole number" if self.is_whole else "finite decimal number"
        ends = [f"from {self.low:g}" * (self.low > -math.inf)]
        ends += [f"to {self.high:g}" * (self.high < math.inf)]
        return " ".join([f"a {kind}", *filter(None, ends)]) + ", or none" * self.can_be_empty


ANY = Column(low=-math.inf, high=math.inf, can_be_empty=True)  # what no statistic is made of
SEED = Column(low=0, high=2**31 - 1, is_whole=True)
EPISODE_SEED = Column(low=0, high=2**53, is_whole=True)  # blocks of episodes count from seeds up
SECONDS = Column(low=0, high=1e9)


def read(
    path: Path,
    stage: str,
    owner: Mapping[str, str | int],
    columns: Mapping[str, Column],
    others: Column | None = None,
    has_rows: bool = True,
) -> Table:
    """Read a CSV file, and check all that can be said of each row by itself.

    Args:
        path: The file.
        stage: The stage that writes it, for the messages.
        owner: Whose table it is: its first columns, with the text that every row has in them.
        columns: The columns that follow, in order.
        others: What further columns hold; by default there are none.
        has_rows: Whether it has any rows.

    Returns:
        The columns, without those of the owner.

    Raises:
        InputError: The file is missing or is not such a table; the message says what was given,
            what is allowed and what to run.
    """
    content = read_bytes(path, stage)
    with blamed(path, stage):
        if content and not content.endswith(b"\n"):
            raise ValueError("its last line is cut off")
        table = _parse(content.decode(), owner, columns, others)
        num_rows = len(next(iter(table.values())))
        if has_rows != (num_rows > 0):
            allowed = "1 or more" if has_rows else "none"
            raise ValueError(f"given {num_rows or 'no'} rows in it, allowed: {allowed}")
    return table


def read_growing(
    path: Path, stage: str, owner: Mapping[str, str | int], columns: Mapping[str, Column]
) -> Table:
    """Read the whole lines of a CSV file, which may be in the making; {} before it has a header.

    Columns after `columns` hold numbers or nothing.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return {}
    lines = content[: content.rfind(b"\n") + 1]
    with blamed(path, stage):
        return _parse(lines.decode(), owner, columns, ANY) if lines else {}


def to_csv(rows: Sequence[Mapping[str, Any]], columns: Iterable[str] = ()) -> str:
    """Return the content of a CSV file; its columns are by default those of the first row."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(columns or rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def exactly(table: Table, asked: Sequence[Sequence[float | str]], *keys: str) -> Table:
    """Return the rows whose cells in the columns `keys` are those of `asked`, in that order.

    A row that is missing, is there twice or is not asked for raises a ValueError.
    """
    given = list(zip(*(table[key].tolist() for key in keys), strict=True))
    wanted, counts = dict.fromkeys(map(tuple, asked)), Counter(given)
    for row in (*wanted, *given):
        if counts[row] != (row in wanted):
            named = ", ".join(
                f"{key} {cell if isinstance(cell, str) else f'{cell:.0f}'}"
                for key, cell in zip(keys, row, strict=True)
            )
            raise ValueError(f"given {counts[row]} rows of {named}, allowed: {int(row in wanted)}")
    places = {row: place for place, row in enumerate(given)}
    order = [places[row] for row in wanted]
    return {name: column[order] for name, column in table.items()}


@contextmanager
def blamed(path: Path, stage: str) -> Iterator[None]:
    """Turn a ValueError about a file into an InputError that names it and the stage to run."""
    try:
        yield
    except ValueError as error:
        raise InputError(f"{path}: {error}; run `dvc repro --force {stage}`") from error


def _parse(
    text: str,
    owner: Mapping[str, str | int],
    columns: Mapping[str, Column],
    others: Column | None,
) -> Table:
    """Return the table that a CSV file's text holds, or raise a ValueError."""
    header, rows = _split(text)
    _check_header(header, [*owner, *columns], others is not None)
    _check_owner(rows, owner)
    return {
        name: np.array(_parsed(name, columns.get(name, others or ANY), rows, place))
        for place, name in enumerate(header)
        if name not in owner
    }


def _split(text: str) -> tuple[list[str], list[list[str]]]:
    """Return the header of a CSV file's text, and its rows."""
    try:
        header, *rows = [row for row in csv.reader(text.splitlines()) if row] or [[]]
    except csv.Error as error:
        raise ValueError(str(error)) from error
    for number, row in enumerate(rows, start=1):
        if len(row) != len(header):
            raise ValueError(f"row {number}: given {len(row)} cells, allowed: {len(header)}")
    return header, rows


def _check_header(header: Sequence[str], columns: Sequence[str], has_others: bool) -> None:
    """Raise a ValueError unless the columns come first, in order, each name once."""
    twice = [name for name, count in Counter(header).items() if count > 1]
    lacking = [name for name in columns if name not in header]
    more = [name for name in header if name not in columns]
    fault = (
        f"column {twice[0]!r} twice" if twice else
        f"no column {lacking[0]!r}" if lacking else
        f"a column {more[0]!r}" if more and not has_others else
        "another order" if list(header[: len(columns)]) != list(columns) else
        ""
    )  # fmt: skip
    if fault:
        raise ValueError(f"given {fault[:LONGEST]}, allowed: the columns {', '.join(columns)}")


def _check_owner(rows: Sequence[Sequence[str]], owner: Mapping[str, str | int]) -> None:
    """Raise a ValueError unless all rows begin with the owner's text."""
    allowed = [str(value) for value in owner.values()]
    for number, row in enumerate(rows, start=1):
        if row[: len(owner)] != allowed:
            given = _named(dict(zip(owner, row, strict=False)))
            raise ValueError(
                f"row {number}: given one of {given}, allowed: rows of {_named(owner)}"
            )


def _named(owner: Mapping[str, str | int]) -> str:
    return ", ".join(f"{key} {str(value)[:LONGEST]}" for key, value in owner.items())


def _parsed(
    name: str, kind: Column, rows: Sequence[Sequence[str]], place: int
) -> list[float | str]:
    """Return the values of one column."""
    values = []
    for number, row in enumerate(rows, start=1):
        try:
            values.append(kind.parse(row[place]))
        except ValueError as error:
            raise ValueError(f"row {number}, column {name}: {error}") from error
    return values
