"""Workers: what runs jobs in other processes, and what is heard of the jobs."""

import threading
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

# Returns the items of a job, and ends early if the event is set. It must be picklable.
Work = Callable[[threading.Event], Iterator[Any]]


@dataclass(frozen=True)
class Item:
    """The next item of a job.

    Attributes:
        content: The item.
    """

    content: Any


@dataclass(frozen=True)
class Ended:
    """A job has yielded its last item."""


@dataclass(frozen=True)
class Died:
    """The worker of a job has died.

    Attributes:
        cause: How, in a few words.
    """

    cause: str


News = Item | Ended | Died


class Workers(Protocol):
    """Processes that each run one job at a time."""

    def run(self, key: Hashable, work: Work) -> None:
        """Start a job, in a process that is idle or else a new one.

        Raises:
            WorkerError: No process can be started.
        """

    def news(self, timeout: float) -> Iterator[tuple[Any, News]]:
        """Wait for news of running jobs, and yield each job's key with the next of it.

        Args:
            timeout: How long to wait at most [s].

        Raises:
            Exception: What a job raised.
        """

    def stop(self) -> None:
        """Ask all running jobs to stop."""

    def close(self) -> None:
        """End all processes."""
