"""Write CSV files, and read them: whole, of whom they should be, and within their ranges.

The modules that know a table (`training.curves`, `evaluation.episodes`) describe its columns.
"""

import csv
import io
import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from jumping_ant.base.files import blamed, read_bytes

LARGEST = 1e30  # of what is compared: statistics of such numbers are finite
LONGEST = 40  # characters that a message quotes
MOST_COLUMNS = 200  # of a table; more would take pandas minutes

Table = dict[str, NDArray[Any]]
"""A table by column, each of shape (num_rows,): numbers, NaN for empty cells, or words."""


@dataclass(frozen=True)
class Column:
    """What a cell may hold: a number from `low` to `high`, or one of some words."""

    low: float = -LARGEST
    high: float = LARGEST
    is_whole: bool = False
    can_be_empty: bool = False
    words: tuple[str, ...] = ()

    def __str__(self) -> str:
        if self.words:
            return ", ".join(self.words)
        kind = "whole number" if self.is_whole else "number"
        return f"a {kind} from {self.low:g} to {self.high:g}" + ", or none" * self.can_be_empty


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
    load: Callable[[Path], bytes] | None = None,
) -> Table:
    """Return the columns of a CSV file after those of its owner, each cell of which is checked.

    Args:
        path: The file; an InputError says that it is missing or is not such a table.
        stage: The stage that writes it, for the messages.
        owner: The first columns, with the text that every row has in them.
        columns: The columns that follow, in order.
        others: What further columns hold; by default there are none.
        has_rows: Whether it has any rows.
        load: Returns the content of the file; by default whatever it holds.
    """
    content = load(path) if load else read_bytes(path, stage)
    with blamed(stage, path):
        if content and not content.endswith(b"\n"):
            raise ValueError("its last line is cut off")
        table = _parse(content, owner, columns, others)
        if has_rows != bool(num_rows := len(next(iter(table.values())))):
            allowed = "1 or more" if has_rows else "none"
            raise ValueError(f"given {num_rows} rows, allowed: {allowed}")
    return table


def read_growing(
    path: Path, stage: str, owner: Mapping[str, str | int], columns: Mapping[str, Column]
) -> Table:
    """Read the whole lines of a CSV file in the making, whose further columns may hold anything.

    Returns {} before it has a header.
    """
    content = path.read_bytes() if path.exists() else b""
    lines = content[: content.rfind(b"\n") + 1]
    with blamed(stage, path):
        return _parse(lines, owner, columns, ANY) if lines else {}


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
            cells = (str(cell).removesuffix(".0") for cell in row)
            named = ", ".join(map(" ".join, zip(keys, cells, strict=True)))
            raise ValueError(f"given {counts[row]} rows of {named}, allowed: {int(row in wanted)}")
    places = {row: place for place, row in enumerate(given)}
    order = [places[row] for row in wanted]
    return {name: column[order] for name, column in table.items()}


def _parse(
    content: bytes,
    owner: Mapping[str, str | int],
    columns: Mapping[str, Column],
    others: Column | None,
) -> Table:
    import pandas as pd  # takes half a second, and training only writes

    if content.partition(b"\n")[0].count(b",") >= MOST_COLUMNS:
        raise ValueError(f"given more columns than {MOST_COLUMNS}")
    whose = {name: Column(words=(str(value),)) for name, value in owner.items()}
    kinds = {**whose, **columns}
    words = {name: str for name, kind in kinds.items() if kind.words}
    frame = pd.read_csv(
        io.BytesIO(content), dtype=words, na_values=[""], keep_default_na=False, low_memory=False
    )
    names = list(frame)
    if names[: len(kinds)] != list(kinds) or (len(names) > len(kinds) and others is None):
        given = ", ".join(names)[:LONGEST]
        raise ValueError(f"given the columns {given}, allowed: the columns {', '.join(kinds)}")
    if not isinstance(frame.index, pd.RangeIndex):
        raise ValueError("given more cells than columns, allowed: one for each column")
    for name in names if len(frame) else ():
        kind, cells = kinds.get(name, others or ANY), frame[name]
        if kind.words:
            fit = cells.isin(kind.words)
        else:
            numbers = pd.to_numeric(cells, errors="coerce")
            fit = numbers.between(kind.low, kind.high) & ((numbers % 1 == 0) | (not kind.is_whole))
            fit |= cells.isna() & kind.can_be_empty
        if not fit.all():
            row = int(fit.argmin())
            cell = str(cells[row])[:LONGEST]
            raise ValueError(f"row {row + 1}, column {name}: given {cell!r}, allowed: {kind}")
    kept = [name for name in names if name not in owner]
    return {name: frame[name].to_numpy(str if name in words else float) for name in kept}
