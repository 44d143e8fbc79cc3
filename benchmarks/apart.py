"""Contenders in separate processes, so that they share no threads, memory or imports.

A contender is a function that sets up its work and returns a function that does the work once and
returns a figure. Contenders must be picklable by name, as `functools.partial` is.
"""

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from typing import TypeVar

from benchmarks.measure import Row, compare

Figure = TypeVar("Figure")


@contextmanager
def apart(*contenders: Callable[[], Callable[[], Figure]]) -> Iterator[Callable[[], list[Figure]]]:
    """Set contenders up, each in a fresh process, where they wait for their turns.

    Args:
        contenders: The contenders, which measure at the same time.

    Yields:
        A function that runs all of them once, at the same time, and returns a figure of each.

    Raises:
        EOFError: A contender failed; its traceback is on standard error.
    """
    spawn = multiprocessing.get_context("spawn")
    connections = []
    processes = []
    try:
        for contender in contenders:
            here, there = spawn.Pipe()
            process = spawn.Process(target=_serve, args=(there, contender))
            process.start()
            there.close()
            connections.append(here)
            processes.append(process)
        for connection in connections:
            connection.recv()  # it is set up
        yield lambda: _turn(connections)
    finally:
        for connection in connections:
            with suppress(BrokenPipeError):  # the contender has failed
                connection.send(False)
        for process in processes:
            process.join()


def compare_apart(
    name: str,
    unit: str,
    ours: Callable[[], Callable[[], float]],
    peer: Callable[[], Callable[[], float]],
    repeats: int = 3,
) -> Row:
    """Compare two contenders (see `benchmarks.measure.compare`)."""
    with apart(ours) as own, apart(peer) as other:
        return compare(name, unit, lambda: own()[0], lambda: other()[0], repeats)


def _turn(connections: Sequence["Connection[bool, Figure]"]) -> list[Figure]:
    for connection in connections:
        connection.send(True)
    return [connection.recv() for connection in connections]


def _serve(connection: Connection, contender: Callable[[], Callable[[], Figure]]) -> None:
    measure = contender()
    connection.send(None)
    while connection.recv():
        connection.send(measure())
