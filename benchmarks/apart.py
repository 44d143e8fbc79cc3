"""Contenders in separate processes, so that they share no threads, memory or imports.

A contender is a function that sets up its work and returns a function that does the work once and
returns a figure. Contenders must be picklable by name, as `functools.partial` is.
"""

import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager

from benchmarks.measure import Row, compare

Contender = Callable[[], Callable[[], float]]
_work: Callable[[], float]  # of this process


@contextmanager
def apart(*contenders: Contender) -> Iterator[Callable[[], list[float]]]:
    """Set contenders up, each in a fresh process, where they wait for their turns.

    Yields:
        A function that runs all of them once, at the same time, and returns a figure of each.
    """
    spawn = multiprocessing.get_context("spawn")
    with ExitStack() as stack:
        pools = [stack.enter_context(ProcessPoolExecutor(1, spawn)) for _ in contenders]
        setups = [pool.submit(_set_up, own) for pool, own in zip(pools, contenders, strict=True)]
        for setup in setups:
            setup.result()
        yield lambda: [turn.result() for turn in [pool.submit(_measure) for pool in pools]]


def compare_apart(name: str, unit: str, ours: Contender, peer: Contender, repeats: int = 3) -> Row:
    """Compare two contenders (see `benchmarks.measure.compare`)."""
    with apart(ours) as own, apart(peer) as other:
        return compare(name, unit, lambda: own()[0], lambda: other()[0], repeats)


def _set_up(contender: Contender) -> None:
    global _work
    _work = contender()


def _measure() -> float:
    return _work()
