"""One row of the benchmark: the project and a peer on the same work, in turn.

Machines are noisy and differ, so what counts is the ratio of two figures taken right after each
other. The median over several such pairs is reported, with their spread.

A contender is a function that sets up its work and returns a function that does the work once and
returns a figure. It has a process of its own, so that contenders share no threads, memory or
imports, and must be picklable by name, as `functools.partial` is.
"""

import multiprocessing
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from jumping_ant.base import machine

CORES = machine.num_cores()

Contender = Callable[[], Callable[[], float]]
_work: Callable[[], float]  # of this process


@dataclass(frozen=True)
class Row:
    """A comparison; figures and ratio are medians over the repeats."""

    name: str
    ours: float
    peer: float
    unit: str  # of both figures
    ratio: float  # ours over the peer's
    spread: float  # largest minus smallest ratio, over the median ratio


def row(name: str, unit: str, pairs: Sequence[Sequence[float]]) -> Row:
    """Return the comparison of pairs of figures: ours, and the peer's right after it."""
    ours, peer = (statistics.median(figures) for figures in zip(*pairs, strict=True))
    ratios = [first / second for first, second in pairs]
    ratio = statistics.median(ratios)
    return Row(name, ours, peer, unit, ratio, spread=(max(ratios) - min(ratios)) / ratio)


def compare(
    name: str, unit: str, ours: Callable[[], float], peer: Callable[[], float], repeats: int = 3
) -> Row:
    """Measure both in turn, several times; each function does its work and returns a figure."""
    return row(name, unit, [(ours(), peer()) for _ in range(repeats)])


def compare_apart(name: str, unit: str, ours: Contender, peer: Contender, repeats: int = 3) -> Row:
    """Compare two contenders."""
    with apart(ours) as first, apart(peer) as second:
        return compare(name, unit, lambda: first()[0], lambda: second()[0], repeats)


def rate(work: Callable[[], object], amount: float) -> float:
    """Do an amount of work, in any unit, and return how much is done per second."""
    started = time.perf_counter()
    work()
    return amount / (time.perf_counter() - started)


@contextmanager
def apart(*contenders: Contender) -> Iterator[Callable[[], list[float]]]:
    """Set contenders up, each in a fresh process, where they wait for their turns.

    Yields:
        A function that runs all of them once, at the same time, and returns a figure of each.
    """
    spawn = multiprocessing.get_context("spawn")
    with ExitStack() as stack:
        pools = [stack.enter_context(ProcessPoolExecutor(1, spawn)) for _ in contenders]
        for setup in [pool.submit(_set_up, it) for pool, it in zip(pools, contenders, strict=True)]:
            setup.result()
        yield lambda: [turn.result() for turn in [pool.submit(_measure) for pool in pools]]


def _set_up(contender: Contender) -> None:
    global _work
    _work = contender()


def _measure() -> float:
    return _work()
