"""Parts of a job's work on other cores of the Ray cluster that the job itself runs on.

Jobs share the cluster's cores evenly. A part is an actor that holds a core; one that does not start
soon, as others have the cores, is given up, so that no job waits for what another holds. Ray ends
the actors with that of the job, which `jobs` runs again.
"""

import pickle
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Generic

from jumping_ant.compute.cluster import kind
from jumping_ant.compute.parts import Message, Part, Result, Rows, split

SECONDS_TO_START = 60.0


@dataclass(frozen=True)
class ClusterSpread:
    """Spreads the work of one of `num_jobs` that run at a time (see `parts.Spread`)."""

    num_jobs: int

    def __call__(self, make: Callable[[], Part], size: int) -> "ClusterParts[Part]":
        """Return a part in this process, and one on each core that is free for this job."""
        import ray

        cores = int(ray.cluster_resources().get("CPU", 1))
        return ClusterParts(make, size, min(cores // self.num_jobs, size) - 1)


class ClusterParts(Generic[Part]):
    """A part here, which works, too, and others in actors, while these live."""

    def __init__(self, make: Callable[[], Part], size: int, num_others: int) -> None:
        import ray

        self._ray = ray
        errors = ray.exceptions
        self._lost = (errors.RayActorError, errors.ObjectLostError, errors.OutOfMemoryError)
        self._own, self._size = make(), size
        actor: Any = ray.remote(_Other)
        others = [actor.options(num_cpus=1).remote() for _ in range(num_others)]
        kinds = {other.kind.remote(): other for other in others}
        started, _ = ray.wait(list(kinds), num_returns=len(kinds), timeout=SECONDS_TO_START)
        alike = {kinds[one] for one in started if self._lives(one) and ray.get(one) == kind()}
        # On a machine that computes other bytes, none works.
        self._keep((other, other in alike) for other in others)
        made = pickle.dumps(make)
        while self._answers([other.make.remote(made) for other in self._others]) is None:
            pass

    def map(
        self, function: Callable[[Part, Message], Result], message: Callable[[Rows], Message]
    ) -> list[Result]:
        """Have each part work on a message made for its rows; return results in rows' order."""
        while True:
            own, *others = split(self._size, 1 + len(self._others))
            waiting = [
                other.work.remote(function, message(rows))
                for other, rows in zip(self._others, others, strict=True)
            ]
            first = function(self._own, message(own))
            answers = self._answers(waiting)
            if answers is not None:
                return [first, *answers]

    def _answers(self, waiting: list[Any]) -> list[Any] | None:
        """Return what all others answer; None if some are lost, who are none of them any more."""
        try:
            answers: list[Any] = self._ray.get(waiting)
            return answers
        except self._lost:
            self._keep(zip(self._others, map(self._lives, waiting), strict=True))
            return None

    def _lives(self, one: Any) -> bool:
        """Tell whether whoever is to answer lives until then."""
        try:
            self._ray.get(one)
        except self._lost:
            return False
        return True

    def _keep(self, others: Iterable[tuple[Any, bool]]) -> None:
        """Keep some of the others, and end the rest."""
        self._others = []
        for other, is_kept in others:
            if is_kept:
                self._others.append(other)
            else:
                self._ray.kill(other)  # it may be about to start, or hang


class _Other:
    """A process with a part."""

    def kind(self) -> dict[str, str]:
        """Return what the bytes that this machine computes depend on."""
        return kind()

    def make(self, made: bytes) -> bool:
        """Make the part, which where a package is missing cannot even be read."""
        self._part = pickle.loads(made)()
        return True

    def work(self, function: Callable[[Any, Any], Any], message: Any) -> Any:
        """Return what the part makes of a message."""
        return function(self._part, message)
