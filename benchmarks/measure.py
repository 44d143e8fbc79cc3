"""One row of the benchmark: the project and a peer on the same work, in turn.

Machines are noisy and differ, so what counts is the ratio of two figures taken right after each
other. The median over several such pairs is reported, with their spread.
"""

import statistics
import time
from collections.abc import Callable
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


def compare(
    name: str, unit: str, ours: Callable[[], float], peer: Callable[[], float], repeats: int = 3
) -> Row:
    """Measure both in turn, several times.

    Args:
        name: Name of the row.
        unit: Unit of both figures.
        ours: Does the work the project's way and returns its figure.
        peer: Does the same work the peer's way and returns its figure.
        repeats: Pairs of measurements.
    """
    pairs = [(ours(), peer()) for _ in range(repeats)]
    ratios = [own / other for own, other in pairs]
    ratio = statistics.median(ratios)
    return Row(
        name=name,
        ours=statistics.median(own for own, _ in pairs),
        peer=statistics.median(other for _, other in pairs),
        unit=unit,
        ratio=ratio,
        spread=(max(ratios) - min(ratios)) / ratio,
    )


def rate(work: Callable[[], object], amount: float) -> float:
    """Return the amount of work done per second.

    Args:
        work: Does all of it.
        amount: How much it is, in any unit.
    """
    started = time.perf_counter()
    work()
    return amount / (time.perf_counter() - started)
