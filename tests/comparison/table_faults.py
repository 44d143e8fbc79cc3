"""Faults of tables: of their structure, which must be noticed, and of their numbers.

A number that is as good as another cannot be told from it by reading (DVC's digests can): such a
fault may change results, but no more than that.
"""

import random
from collections.abc import Iterator

STRUCTURE, NUMBERS = "structure", "numbers"
NOT_NUMBERS = ("x", "0x10", "1,5", "1;5", "1_000", "\u0663")
ODD_NUMBERS = ("+1", ".5", "1.", "01", "nan", "inf", "-inf", "1e999")  # as no stage writes them
EXTREMES = ("", "0", "-1", "0.5", "1e-30", "1e+12", "-1e+12", "1e+30", "-1e+30", "1e+308")

Rows = list[list[str]]


def faults(content: bytes, generator: random.Random) -> Iterator[tuple[str, str, bytes]]:
    """Yield versions of a table with a fault at a random place: its kind, its name, the content."""
    lines = content.decode().splitlines()
    header, rows = lines[0].split(","), [line.split(",") for line in lines[1:]]
    for name, changed in _of_structure(header, rows, generator):
        yield STRUCTURE, name, _joined(changed)
    for cell in NOT_NUMBERS:
        yield STRUCTURE, f"a cell {cell!r}", _joined(_with_cell(header, rows, cell, generator))
    for cell in (*ODD_NUMBERS, *EXTREMES):
        yield NUMBERS, f"a cell {cell!r}", _joined(_with_cell(header, rows, cell, generator))
    yield STRUCTURE, "its last line cut", content[: -generator.randint(1, len(lines[-1]))]
    yield STRUCTURE, "nothing", b""


def _of_structure(
    header: list[str], rows: Rows, generator: random.Random
) -> Iterator[tuple[str, Rows]]:
    """Yield tables with other rows or columns."""
    row, column = generator.randrange(len(rows)), generator.randrange(len(header))
    other = (column + generator.randrange(1, len(header))) % len(header)
    whole = [header, *rows]
    yield "no rows", [header]
    yield "one row", whole[:2]
    yield "a row less", [header, *rows[:row], *rows[row + 1 :]]
    yield "a row twice", [header, *rows[: row + 1], *rows[row:]]
    yield "all rows twice", [*whole, *rows]
    yield "rows in another order", [header, *generator.sample(rows, len(rows))]
    yield "a column less", [cells[:column] + cells[column + 1 :] for cells in whole]
    yield "a column twice", [[*cells, cells[column]] for cells in whole]
    yield "a second return", [[*header, "return"], *([*cells, "1"] for cells in rows)]
    yield "a name changed", [[*header[:column], "other", *header[column + 1 :]], *rows]
    swapped = list(header)
    swapped[column], swapped[other] = header[other], header[column]
    yield "two names swapped", [swapped, *rows]
    yield "no header", rows
    yield "another agent's", [header, *(["other", *cells[1:]] for cells in rows)]
    yield "another seed's", [header, *([cells[0], "9", *cells[2:]] for cells in rows)]


def _with_cell(header: list[str], rows: Rows, cell: str, generator: random.Random) -> Rows:
    """Return the table with another cell at a random place that is not empty."""
    changed = [list(cells) for cells in rows]
    row, column = generator.choice(
        [(i, k) for i, cells in enumerate(rows) for k, old in enumerate(cells) if old]
    )
    changed[row][column] = cell
    return [header, *changed]


def _joined(rows: Rows) -> bytes:
    return "".join(",".join(cells) + "\n" for cells in rows).encode()
