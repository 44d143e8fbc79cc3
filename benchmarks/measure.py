"""One row of the benchmark: the project and a peer on the same work, in turn.

Machines are noisy and differ, so what counts is the ratio of two figures taken right after each
other. The median over several such pairs is reported, with their spread.
"""

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """A comparison.

    Attributes:
        name: Name of the row.
        ours: The project's figure, median over the repeats.
        peer: The peer's figure, median over the repeats.
        unit: Unit of both figures.
        ratio: Our figure over the peer's, median over the repeats.
        spread: Largest minus smallest ratio, over the median ratio.
    """

    name: str
    ours: float
    peer: float
    unit: str
    ratio: float
    spread: float


def row(name: str, unit: str, pairs: Sequence[Sequence[float]]) -> Row:
    """Return the comparison of pairs of figures: ours, and the peer's right after it."""
    ours, peer = (statistics.median(figures) for figures in zip(*pairs, strict=True))
    ratios = [own / other for own, other in pairs]
    ratio = statistics.median(ratios)
    return Row(name, ours, peer, unit, ratio, spread=(max(ratios) - min(ratios)) / ratio)


def compare(
    name: str, unit: str, ours: Callable[[], float], peer: Callable[[], float], repeats: int = 3
) -> Row:
    """Measure both in turn, several times; each function does its work and returns a figure."""
    return row(name, unit, [(ours(), peer()) for _ in range(repeats)])


def rate(work: Callable[[], object], amount: float) -> float:
    """Do an amount of work, in any unit, and return how much is done per second."""
    started = time.perf_counter()
    work()
    return amount / (time.perf_counter() - started)
