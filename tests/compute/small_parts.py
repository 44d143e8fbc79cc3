"""A small part of a job's work, and jobs with it. Workers import this module."""

import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

from jumping_ant.compute import cluster_parts
from jumping_ant.compute.cluster_parts import ClusterSpread
from jumping_ant.compute.parts import Rows

SIZE = 7


class Square:
    """A part that squares numbers, and tells where."""

    def work(self, numbers: Rows) -> tuple[int, list[int]]:
        return os.getpid(), [int(number) ** 2 for number in numbers]

    def die_once(self, message: tuple[Path, Rows]) -> tuple[int, list[int]]:
        """End the process with the last rows, as a host without power does, but only the first."""
        mark, numbers = message
        if numbers[-1] == SIZE - 1 and not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return self.work(numbers)


Answers = list[tuple[int, list[int]]]


def squares(spread: ClusterSpread, stop: threading.Event) -> Iterator[Answers]:
    yield spread(Square, SIZE).map(Square.work, lambda rows: rows)


def squares_nevertheless(mark: Path, stop: threading.Event) -> Iterator[Answers]:
    parts = ClusterSpread(1)(Square, SIZE)
    for _ in range(2):
        yield parts.map(Square.die_once, lambda rows: (mark, rows))


def squares_of_one_kind(stop: threading.Event) -> Iterator[Answers]:
    cluster_parts.kind = lambda: {"mujoco": "another"}  # of this process: the others are unlike
    yield from squares(ClusterSpread(1), stop)


def squares_without_cores(stop: threading.Event) -> Iterator[Answers]:
    cluster_parts.SECONDS_TO_START = 2.0
    yield from squares(ClusterSpread(1), stop)
    stop.wait(3.0)  # holds its core while others look for one
