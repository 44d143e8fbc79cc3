"""What a search for settings may choose from: the ranges of an algorithm's settings."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Between:
    """Numbers from `low` to `high`, both included."""

    low: float
    high: float
    is_log: bool = True  # equal ratios are equally likely at first, instead of equal differences
    is_whole: bool = False  # only whole numbers count

    def has(self, value: Any) -> bool:
        """Return whether a value lies in the range."""
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        return is_number and self.low <= value <= self.high


@dataclass(frozen=True)
class OneOf:
    """Some values, in no order."""

    values: tuple[Any, ...]

    def has(self, value: Any) -> bool:
        """Return whether a value is one of them."""
        return value in self.values


Ranges = Mapping[str, Between | OneOf]
"""Of an algorithm, by the setting's name and in its unit."""


def whole(low: int, high: int, is_log: bool = True) -> Between:
    """Return a range of whole numbers."""
    return Between(low, high, is_log, is_whole=True)
