"""Parts of a training's work that run at the same time: in threads here, or on other machines."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

Part = TypeVar("Part", covariant=True)
Message = TypeVar("Message")
Result = TypeVar("Result")
Rows = NDArray[np.int64]


class Parts(Protocol[Part]):
    """Objects of one kind, among which rows are split.

    A part keeps nothing that a later result depends on, and does not change what it is given: where
    one is lost, the others do the same work again, split anew. No result may depend on the split.
    """

    def map(
        self, function: Callable[[Part, Message], Result], message: Callable[[Rows], Message]
    ) -> list[Result]:
        """Have each part work on a message made for its rows; return results in rows' order."""


class Spread(Protocol):
    """Makes parts, at most one for each of `size` rows."""

    def __call__(self, make: Callable[[], Any], size: int) -> Parts[Any]:
        """Return parts, each made by a call of `make`, which must be picklable."""


class Threads(Generic[Part]):
    """Parts in threads of this process, each of which works from start to end: none waits."""

    def __init__(self, make: Callable[[], Part], size: int, num_threads: int) -> None:
        self._rows = split(size, num_threads)
        self._parts = [make() for _ in self._rows]
        self._pool = ThreadPoolExecutor(len(self._rows))

    def map(
        self, function: Callable[[Part, Message], Result], message: Callable[[Rows], Message]
    ) -> list[Result]:
        """Have each part work on a message made for its rows; return results in rows' order."""
        return list(self._pool.map(function, self._parts, map(message, self._rows)))


def split(size: int, count: int) -> Sequence[Rows]:
    """Return `size` rows in `count` runs of about equal length, fewer if there are fewer rows."""
    return np.array_split(np.arange(size), min(size, count))
