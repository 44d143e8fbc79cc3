"""The table of a study's trials, which `jumping_ant.tuning` writes."""

import csv
import math
from pathlib import Path

COLUMNS = ("trial", "state", "value", "returns", "seconds", "reason", "settings")
"""Number; `complete` or `pruned`; value, empty if there is none; return and training seconds of
each trained seed; why it ended early; as JSON the settings that differ from the agent's own."""


def read(path: Path) -> list[dict[str, str]]:
    """Return the rows of a table; [] if there is none."""
    if not path.is_file():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def value(row: dict[str, str]) -> float:
    """Return the value of a trial, NaN if it has none."""
    return float(row["value"] or math.nan)
