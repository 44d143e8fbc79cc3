"""Workers on this machine: processes that reach their driver through a pipe, and nobody else.

Nothing listens, and nothing lies in a folder that others can write to: a worker inherits one end of
a socket pair that has no address. When the driver ends, however it does, the pipe closes and the
worker ends.
"""

import multiprocessing
import os
import pickle
import queue
import signal
import threading
from collections.abc import Hashable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any, cast

from jumping_ant.base import machine, output
from jumping_ant.base.errors import WorkerError
from jumping_ant.compute.workers import Died, Ended, Item, News, Work

SECONDS_TO_END = 5.0
_STOP = b""  # in place of a pickled job
# Libraries read these when they are imported.
_VARIABLES = ("OMP_NUM_THREADS", "MKL_NUM_THREADS")
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


@dataclass(frozen=True, eq=False)
class _Worker:
    """A process, and the driver's end of its pipe."""

    process: SpawnProcess
    pipe: Connection

    def send(self, message: bytes) -> None:
        with suppress(ConnectionError):  # it has died, which its pipe tells
            self.pipe.send_bytes(message)

    def end(self) -> None:
        self.pipe.close()
        self.process.join(SECONDS_TO_END)
        self.process.kill()
        self.process.join()


class Processes:
    """Processes of this machine that each run one job at a time (see `workers.Workers`)."""

    def __init__(self) -> None:
        self._idle: list[_Worker] = []
        self._running: dict[Connection, tuple[Any, _Worker]] = {}

    def run(self, key: Hashable, work: Work) -> None:
        """Start a job."""
        worker = self._idle.pop() if self._idle else _start()
        self._running[worker.pipe] = key, worker
        worker.send(pickle.dumps(work))

    def news(self, timeout: float) -> Iterator[tuple[Any, News]]:
        """Wait for news of running jobs."""
        for pipe in cast(list[Connection], wait(list(self._running), timeout)):
            key, worker = self._running[pipe]
            try:
                received = pipe.recv()
            except (EOFError, ConnectionError):
                received = Died(_cause(worker.process))
                pipe.close()
            if isinstance(received, BaseException):
                raise received
            if not isinstance(received, Item):
                del self._running[pipe]
            if isinstance(received, Ended):
                self._idle.append(worker)
            yield key, received

    def stop(self) -> None:
        """Ask all running jobs to stop."""
        for _, worker in self._running.values():
            worker.send(_STOP)

    def close(self) -> None:
        """End all processes."""
        for worker in [*self._idle, *(worker for _, worker in self._running.values())]:
            worker.end()


def _start() -> _Worker:
    """Start a worker; a WorkerError says why the system lets no process start."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs,))
    try:
        resource_tracker.ensure_running()  # or the first start does so, and unblocks signals
        with _inherited():
            process.start()
    except OSError as error:
        ours.close()
        raise WorkerError(f"no worker can be started: {error.strerror}") from error
    finally:
        theirs.close()
    return _Worker(process, ours)


@contextmanager
def _inherited() -> Iterator[None]:
    """Set what a new process inherits: few threads, and signals that wait for ever.

    Ctrl-C reaches every process of the terminal, but only the driver decides what follows from it.
    """
    before = {name: os.environ.get(name) for name in _VARIABLES}
    os.environ.update(dict.fromkeys(_VARIABLES, str(machine.BLAS_THREADS)))
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _serve(pipe: Connection) -> None:
    """Run the jobs that arrive, one after another, until the driver closes the pipe."""
    output.tolerate_failures()
    jobs: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    stop = threading.Event()
    try:
        threading.Thread(target=_listen, args=(pipe, jobs, stop), daemon=True).start()
    except RuntimeError as error:  # at the limit of their number
        _tell(pipe, error)
        return
    while True:
        try:
            work: Work = pickle.loads(jobs.get())
            for item in work(stop):
                _tell(pipe, Item(item))
            _tell(pipe, Ended())
        except BaseException as error:  # the driver raises it
            _tell(pipe, error)


def _tell(pipe: Connection, news: News | BaseException) -> None:
    with suppress(ConnectionError):  # the driver is gone, which ends this process
        pipe.send(news)


def _listen(pipe: Connection, jobs: "queue.SimpleQueue[bytes]", stop: threading.Event) -> None:
    """Take what the driver sends; end this process when the driver is gone."""
    while True:
        try:
            message = pipe.recv_bytes()
        except (EOFError, OSError):
            os._exit(1)
        if message == _STOP:
            stop.set()
        else:
            jobs.put(message)


def _cause(process: SpawnProcess) -> str:
    process.join()
    code = process.exitcode or 0
    return f"exit status {code}" if code >= 0 else signal.Signals(-code).name
