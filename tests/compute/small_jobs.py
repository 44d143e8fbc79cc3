"""Jobs that all workers can import: `PYTHONPATH` names this folder (see `conftest.py`)."""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from jumping_ant.base.errors import InputError
from jumping_ant.compute import jobs
from jumping_ant.compute.processes import Work


def count(key: str, length: int, stop: threading.Event) -> Iterator[str]:
    for number in range(length):
        yield f"{key}{number}"


def send_back(given: Any, stop: threading.Event) -> Iterator[Any]:
    yield given


def fail(stop: threading.Event) -> Iterator[str]:
    yield "a start"
    raise InputError("a clear line")


def die(folder: Path, stop: threading.Event) -> Iterator[str]:
    """Kill this process with its first item on the way."""
    (folder / str(os.getpid())).touch()
    yield "a start"
    os.kill(os.getpid(), signal.SIGKILL)


def wait_for_the_end(folder: Path, key: str, stop: threading.Event) -> Iterator[str]:
    yield "begun"
    (folder / key).touch()
    assert stop.wait(60)
    yield "stopped"


def tell(given: Mapping[int, str], num_threads: int) -> tuple[int, dict[int, str], int]:
    """Return the process, and what it was given."""
    return os.getpid(), dict(given), num_threads


def die_once(folder: Path, given: Mapping[int, str], num_threads: int) -> list[str]:
    """Kill the first process of each seed."""
    for seed in given:
        if not (folder / str(seed)).exists():
            (folder / str(seed)).touch()
            os.kill(os.getpid(), signal.SIGKILL)
    return [*given.values()]


def wait(folder: Path, given: Mapping[int, str], num_threads: int) -> None:
    for seed in given:
        (folder / str(seed)).touch()
    time.sleep(600)


@contextmanager
def once_begun(folder: Path, count: int, act: Callable[[], object]) -> Iterator[None]:
    """Act when so many jobs have left a file in a folder."""

    def wait_and_act() -> None:
        while len(list(folder.iterdir())) < count:
            time.sleep(0.01)
        act()

    thread = threading.Thread(target=wait_and_act)
    thread.start()
    yield
    thread.join()


def collect(started: Mapping[str, Work], workers: int) -> dict[str, list[Any]]:
    items: dict[str, list[Any]] = {key: [] for key in started}
    for key, item in jobs.stream(started.__getitem__, list(started), workers, name="job {}".format):
        items[key].append(item)
    return items


COUNTS: dict[str, Work] = {
    key: partial(count, key, length) for key, length in (("a", 3), ("b", 0), ("c", 5))
}
EXPECTED = {key: list(job(threading.Event())) for key, job in COUNTS.items()}
