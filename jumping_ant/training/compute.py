"""Run generators in parallel: inline for one worker, on Ray for more.

Only Ray handles processes and machines. It starts locally by default and joins a running cluster
when `RAY_ADDRESS` names one; Ray then uploads the code, so nothing needs to be shared.
"""

import os
import secrets
import signal
import threading
from collections import Counter, deque
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar, cast

# When Ray starts its servers itself, only this machine may reach them. Ray has no such setting, but
# does this on platforms where it does not support clusters; it reads the variable on import.
if not os.environ.get("RAY_ADDRESS"):
    os.environ.setdefault("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")

import ray  # noqa: E402
import torch  # noqa: E402
from ray._raylet import (  # type: ignore[attr-defined]  # noqa: E402
    AuthenticationTokenLoader,
    Config,
)
from ray.exceptions import (  # noqa: E402
    AuthenticationError,
    OutOfMemoryError,
    RayActorError,
)

import jumping_ant  # noqa: E402
from jumping_ant.base import machine  # noqa: E402
from jumping_ant.base.errors import InputError, WorkerError  # noqa: E402

Key = TypeVar("Key", bound=Hashable)
Job = Callable[[threading.Event], Iterator[Any]]
Say = Callable[[str], None]

# Rows are small, but a checkpoint holds a replay buffer. By default Ray takes a third of all
# memory; the unused part of the store takes none.
OBJECT_STORE_BYTES = 2 * 2**30
MAX_DEATHS = 3  # of a job's workers before the job is given up
SECONDS_BETWEEN_LOOKS = 1.0


def num_workers(requested: int, num_jobs: int) -> int:
    """Return how many workers to use.

    Args:
        requested: As in `params.yaml`; 0 means one per core, or on a cluster one per job.
        num_jobs: Number of jobs, which is the most workers that are useful.
    """
    available = num_jobs if is_on_cluster() else machine.num_cores()
    return max(1, min(requested or available, num_jobs))


def num_threads(requested: int, num_jobs: int) -> list[int]:
    """Return how many threads each job may use, so that no core is idle at the end.

    As many jobs as there are workers run at a time, with one thread each; the jobs of a smaller
    last round share the cores.

    Args:
        requested: As in `params.yaml`; 0 means every core.
        num_jobs: Total number of jobs.
    """
    if is_on_cluster() or num_jobs == 0:
        return [1] * num_jobs
    cores = requested or machine.num_cores()
    last_round = num_jobs % cores or min(cores, num_jobs)
    return [1] * (num_jobs - last_round) + [cores // last_round] * last_round


def stream(
    start: Callable[[Key], Job],
    keys: Sequence[Key],
    workers: int,
    say: Say = print,
    name: Callable[[Key], str] = str,
) -> Iterator[tuple[Key, Any]]:
    """Run generators and yield their items as they arrive.

    The first SIGTERM or Ctrl-C asks them to stop, by setting the event that each was given, and
    keeps others from starting; the second ends everything immediately.

    A generator whose worker dies is restarted by another call of `start`.

    Args:
        start: Returns a function that creates a key's generator; to run in another process, that
            function must be picklable.
        keys: Keys of all generators, in the order they start.
        workers: Number of generators that run at once.
        say: Called with a message when a worker dies.
        name: Returns the name of a key in such messages.

    Yields:
        Key and item. The items of one generator keep their order.

    Raises:
        InputError: `RAY_ADDRESS` names a cluster that cannot be joined.
        WorkerError: The workers of one job died repeatedly.
    """
    return _inline(start, keys) if workers == 1 else _on_ray(start, keys, workers, say, name)


def _inline(start: Callable[[Key], Job], keys: Sequence[Key]) -> Iterator[tuple[Key, Any]]:
    torch.set_num_threads(machine.BLAS_THREADS)
    with _stopped_by_signals() as stop:
        for key in keys:
            if stop.is_set():
                return
            for item in start(key)(stop):
                yield key, item


def _on_ray(
    start: Callable[[Key], Job],
    keys: Sequence[Key],
    workers: int,
    say: Say,
    name: Callable[[Key], str],
) -> Iterator[tuple[Key, Any]]:
    """Run each job in a streaming actor; a key waits until an actor is free."""
    _connect(workers)
    try:
        with _stopped_by_signals() as stop:  # after Ray has set its own handlers
            yield from _work(start, keys, workers, say, name, stop)
    finally:
        ray.shutdown()


def _work(
    start: Callable[[Key], Job],
    keys: Sequence[Key],
    workers: int,
    say: Say,
    name: Callable[[Key], str],
    stop: threading.Event,
) -> Iterator[tuple[Key, Any]]:
    waiting = deque(keys)
    idle: list[Any] = []
    running: dict[Any, tuple[Key, Any]] = {}
    deaths = Counter[Key]()
    is_told = False
    actor: Any = ray.remote(_Worker)
    actor = actor.options(num_cpus=1, max_concurrency=2)  # the second thread serves `stop`
    while True:
        while waiting and len(running) < workers and not stop.is_set():
            key = waiting.popleft()
            worker = idle.pop() if idle else actor.remote()
            running[worker.run.remote(start(key))] = key, worker
        if not running:
            return
        if stop.is_set() and not is_told:
            for _, worker in running.values():
                worker.stop.remote()
            is_told = True
        ready, _ = ray.wait(list(running), num_returns=1, timeout=SECONDS_BETWEEN_LOOKS)
        for generator in ready:
            key, worker = running[generator]
            try:
                yield key, ray.get(next(cast(Iterator[Any], generator)))
            except StopIteration:
                del running[generator]
                if waiting:
                    idle.append(worker)
                else:
                    ray.kill(worker)  # frees its core, which another may wait for
            except (RayActorError, OutOfMemoryError) as error:
                del running[generator]
                deaths[key] += 1
                if deaths[key] > MAX_DEATHS:
                    reason = str(error).strip().partition("\n")[0]
                    raise WorkerError(
                        f"{name(key)}: its worker died {deaths[key]} times: {reason}"
                    ) from error
                say(f"{name(key)}: its worker died, and another takes over")
                waiting.appendleft(key)


class _Worker:
    """A process that runs one job at a time, and can be told to stop while it runs."""

    def __init__(self) -> None:
        self._stop = threading.Event()

    @ray.method(num_returns="streaming")
    def run(self, job: Job) -> Iterator[Any]:
        torch.set_num_threads(machine.BLAS_THREADS)
        yield from job(self._stop)

    def stop(self) -> None:
        self._stop.set()


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


def is_on_cluster() -> bool:
    """Tell whether seeds train on a Ray cluster that runs already."""
    return bool(os.environ.get("RAY_ADDRESS"))


def _connect(workers: int) -> None:
    quiet: dict[str, Any] = {"logging_level": "ERROR", "log_to_driver": False}
    if is_on_cluster():
        package = str(Path(jumping_ant.__file__).parent)
        try:
            ray.init(runtime_env={"py_modules": [package]}, **quiet)
        except (ConnectionError, AuthenticationError) as error:
            reason = str(error).strip().partition("\n")[0]
            raise InputError(
                f"RAY_ADDRESS: given {os.environ['RAY_ADDRESS']!r}, which cannot be joined "
                f"({reason}); allowed: the address of a running cluster (with RAY_AUTH_MODE=token "
                "and its token, where it asks for one), or unset to compute on this machine"
            ) from error
    else:
        _demand_a_token()
        ray.init(
            num_cpus=workers,
            include_dashboard=False,
            object_store_memory=OBJECT_STORE_BYTES,
            **quiet,
        )


def _demand_a_token() -> None:
    """Have Ray's local servers answer only processes that inherit a new random token.

    Whoever reaches them can run code as this user. Ray's own token is kept in a file in the home
    folder which other users of the machine may read; this one is never written.
    """
    os.environ["RAY_AUTH_MODE"] = "token"
    os.environ["RAY_AUTH_TOKEN"] = secrets.token_hex(32)
    Config.initialize("")  # Ray read both variables when it was imported
    AuthenticationTokenLoader.instance().reset_cache()
