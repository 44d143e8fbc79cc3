"""What runs jobs in other processes, and the news of these jobs."""

import threading
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

# Returns the items of a job, and ends early if the event is set. It must be picklable.
Work = Callable[[threading.Event], Iterator[Any]]


@dataclass(frozen=True)
class Item:
    """The next item of a job."""

    content: Any


@dataclass(frozen=True)
class Ended:
    """A job has yielded its last item."""


@dataclass(frozen=True)
class Died:
    """The worker of a job has died."""

    cause: str


News = Item | Ended | Died


class Workers(Protocol):
    """Processes that each run one job."""

    def run(self, key: Hashable, work: Work) -> None:
        """Start a job; if no process starts, raise a WorkerError."""

    def news(self, timeout: float) -> Iterator[tuple[Any, News]]:
        """Yield (key, news) of jobs within `timeout` seconds; raise what a job raised."""

    def stop(self) -> None:
        """Ask all running jobs to stop."""

    def close(self) -> None:
        """End all processes."""
