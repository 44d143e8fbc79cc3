"""Workers on this machine: processes that reach their driver, and nobody else, through a pipe.

A worker inherits one end of a socket pair that has no address. When the driver ends, however it
does, the pipe closes and the worker ends.
"""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Hashable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any, cast

from jumping_ant.base import output
from jumping_ant.base.errors import WorkerError

# Returns the items of a job, and ends early if the event is set. It must be picklable.
Work = Callable[[threading.Event], Iterator[Any]]

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


@dataclass(frozen=True)
class Item:
    """The next item of a job."""

    content: Any


@dataclass(frozen=True)
class Ended:
    """A job has yielded its last item, or its worker has died of a cause."""

    cause: str | None = None


News = Item | Ended


class Processes:
    """A process of this machine for each job."""

    def __init__(self) -> None:
        self._running: dict[Connection, tuple[Any, SpawnProcess]] = {}

    def run(self, key: Hashable, work: Work) -> None:
        """Start a job."""
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs,))
        try:
            resource_tracker.ensure_running()  # or the first start does so, and unblocks signals
            # The worker inherits the mask, as only the driver decides what Ctrl-C does.
            mask = signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)
            try:
                process.start()
            finally:
                signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        except OSError as error:
            raise WorkerError(f"no worker can be started: {error.strerror}") from error
        theirs.close()
        self._running[ours] = key, process
        _send(ours, work)

    def news(self, timeout: float) -> Iterator[tuple[Any, News]]:
        """Yield (key, news) of jobs within `timeout` seconds; raise what a job raised."""
        for pipe in cast(list[Connection], wait(list(self._running), timeout)):
            key, process = self._running[pipe]
            try:
                received = pipe.recv()
            except (EOFError, ConnectionError):
                received = Ended(_cause(process))
            if isinstance(received, BaseException):
                raise received
            if not isinstance(received, Item):
                self._end(pipe)
            yield key, received

    def stop(self) -> None:
        """Ask all running jobs to stop."""
        for pipe in self._running:
            _send(pipe, None)

    def close(self) -> None:
        """End all processes."""
        for pipe in list(self._running):
            self._end(pipe)

    def _end(self, pipe: Connection) -> None:
        _, process = self._running.pop(pipe)
        pipe.close()
        process.kill()
        process.join()


def _serve(pipe: Connection) -> None:
    """Run the job that arrives."""
    output.tolerate_failures()
    stop = threading.Event()
    try:
        work: Work = pipe.recv()
        threading.Thread(target=_listen, args=(pipe, stop), daemon=True).start()
        for item in work(stop):
            _send(pipe, Item(item))
        _send(pipe, Ended())
    except BaseException as error:  # the driver raises it
        _send(pipe, error)


def _send(pipe: Connection, message: Any) -> None:
    with suppress(ConnectionError):  # the other end is gone, which whoever reads the pipe notices
        pipe.send(message)


def _listen(pipe: Connection, stop: threading.Event) -> None:
    """Wait for the driver to ask for a stop; end this process when the driver is gone."""
    with suppress(EOFError, OSError):
        while True:
            pipe.recv()
            stop.set()
    os._exit(1)


def _cause(process: SpawnProcess) -> str:
    process.join()
    code = process.exitcode or 0
    return f"exit status {code}" if code >= 0 else signal.Signals(-code).name
