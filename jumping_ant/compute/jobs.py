"""Run generators in parallel: inline for one worker, else in processes here or on a Ray cluster."""

import signal
import threading
from collections import Counter, deque
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from itertools import islice
from typing import Any, TypeVar

from jumping_ant.base import machine
from jumping_ant.base.errors import StoppedError, WorkerError
from jumping_ant.compute import cluster
from jumping_ant.compute.processes import Item, Processes, Work

Key = TypeVar("Key", bound=Hashable)
Input = TypeVar("Input")
Result = TypeVar("Result")
Say = Callable[[str], None]

MAX_DEATHS = 3  # of a job's workers before the job is given up
SECONDS_BETWEEN_LOOKS = 1.0


def num_workers(requested: int, num_jobs: int) -> int:
    """Return how many workers to use; 0 requests one per core, or on a cluster one per job."""
    available = num_jobs if cluster.address() else machine.num_cores()
    return max(1, min(requested or available, num_jobs))


def num_threads(requested: int, num_jobs: int) -> list[int]:
    """Return how many threads each job may use: one, but the last round's jobs share all cores.

    `requested` 0 means every core.
    """
    if cluster.address() or num_jobs == 0:
        return [1] * num_jobs
    cores = requested or machine.num_cores()
    last_round = num_jobs % cores or min(cores, num_jobs)
    return [1] * (num_jobs - last_round) + [cores // last_round] * last_round


def stream(
    start: Callable[[Key], Work],
    keys: Iterable[Key],
    workers: int,
    say: Say = print,
    name: Callable[[Key], str] = str,
) -> Iterator[tuple[Key, Any]]:
    """Run generators and yield (key, item) as the items arrive.

    Without workers, or with one and without a cluster, they run in this process. The first SIGTERM
    or Ctrl-C sets the event that each of them has, and no other starts; the second ends everything.

    `start` returns a picklable function that creates a key's generator, when a worker is free for
    it and again after the worker's death; repeated deaths are a WorkerError.
    """
    if workers == 0 or (workers == 1 and not cluster.address()):
        return _inline(start, keys)
    return _apart(start, keys, workers, say, name)


def by_seed(
    compute: Callable[[Mapping[int, Input], int], Result],
    seeds: Mapping[int, Input],
    requested: int,
    agent: str,
) -> list[Result]:
    """Compute something of all seeds: here in one go, on a cluster with a job for each seed.

    Args:
        compute: Picklable; computes it of the inputs of some seeds, with a number of threads.
        seeds: The input of each seed.
        requested: How many workers to use; 0 requests one for each seed.
        agent: The agent's name, for messages.

    Returns:
        The one result here, and on a cluster each seed's, in their order.
    """
    workers = num_workers(requested, len(seeds)) if cluster.address() else 1
    if workers == 1:
        return [compute(seeds, machine.num_cores())]

    def start(seed: int) -> Work:
        return partial(_once, partial(compute, {seed: seeds[seed]}, 1))

    name = (agent + ": seed {}").format
    results = dict(_apart(start, seeds, workers, print, name, is_resumed=False))
    return [results[seed] for seed in seeds]


def _once(compute: Callable[[], Result], stop: threading.Event) -> Iterator[Result]:
    yield compute()


def _inline(start: Callable[[Key], Work], keys: Iterable[Key]) -> Iterator[tuple[Key, Any]]:
    with _stopped_by_signals() as stop:
        for key in keys:
            if stop.is_set():
                return
            for item in start(key)(stop):
                yield key, item


def _apart(
    start: Callable[[Key], Work],
    keys: Iterable[Key],
    workers: int,
    say: Say,
    name: Callable[[Key], str],
    is_resumed: bool = True,
) -> Iterator[tuple[Key, Any]]:
    """Run jobs in workers; a key waits until one of them is free."""
    address = cluster.address()
    pool: cluster.Cluster | Processes = cluster.Cluster(address) if address else Processes()
    new, again = iter(keys), deque[Key]()
    num_running = 0
    deaths = Counter[Key]()
    try:
        with _stopped_by_signals() as stop:  # after Ray has set its own handlers
            while True:
                while num_running < workers and not stop.is_set():
                    free = [again.popleft()] if again else list(islice(new, 1))
                    if not free:
                        break
                    pool.run(free[0], start(free[0]))
                    num_running += 1
                if stop.is_set() and not is_resumed:
                    raise StoppedError("the next run begins this stage anew; nothing else is lost")
                if not num_running:
                    return
                if stop.is_set():
                    pool.stop()
                for key, news in pool.news(SECONDS_BETWEEN_LOOKS):
                    if isinstance(news, Item):
                        yield key, news.content
                        continue
                    num_running -= 1
                    if news.cause is not None:
                        deaths[key] += 1
                        died = f"{name(key)}: its worker died"
                        if deaths[key] > MAX_DEATHS:
                            raise WorkerError(f"{died} {deaths[key]} times ({news.cause})")
                        say(f"{died} ({news.cause}), and another takes over")
                        again.appendleft(key)
    finally:
        pool.close()


@contextmanager
def _stopped_by_signals() -> Iterator[threading.Event]:
    """Turn the first SIGTERM or Ctrl-C into an event; the second has its usual effect."""
    stop = threading.Event()
    previous: dict[signal.Signals, Any] = {}

    def restore() -> None:
        for number, handler in previous.items():
            signal.signal(number, handler)

    def handle(number: int, frame: object) -> None:
        stop.set()
        restore()

    if threading.current_thread() is threading.main_thread():  # only this thread may set handlers
        for number in (signal.SIGINT, signal.SIGTERM):
            previous[number] = signal.signal(number, handle)
    try:
        yield stop
    finally:
        restore()
