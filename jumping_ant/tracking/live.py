"""Learning curves, and the machine's load, in MLflow while training runs.

A separate process follows the curve files that training writes. So training neither waits for
MLflow nor fails with it, and a slow or unreachable tracking server costs only the live view:
`track` completes it from the files. Only this follower knows the load, which the comparison shows:
one that `track` creates from files alone has none.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from mlflow.entities import Run

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import digest
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import params_file
from jumping_ant.tracking import reading, records
from jumping_ant.tracking import store as stores
from jumping_ant.tracking.connection import failures_as_input_errors
from jumping_ant.tracking.internals import Monitor
from jumping_ant.tracking.reading import Point
from jumping_ant.tracking.store import Desired, Store

TIMEOUT_SECONDS = 5
MAX_RETRIES = 0
POLL_SECONDS = 5.0  # an MLflow call costs as much as 50 points
PAUSE_SECONDS = 30.0  # after a failure


def follow(agent: str, root: Path, has_ended: Callable[[float], bool]) -> None:
    """Log the learning curves of an agent's seeds until training ends.

    An MLflow failure is reported once, on standard error, and the update is retried later.
    `has_ended` waits for at most the given seconds and returns whether training has ended.
    """
    follower = _Follower(agent, root)
    failures: list[InputError] = []

    def survives(step: Callable[[], None]) -> bool:
        try:
            step()
        except InputError as error:
            if not failures:
                print(
                    f"warning: no live curves: {error}; training goes on, and `track` completes "
                    "MLflow from the files",
                    file=sys.stderr,
                )
            failures.append(error)
            return False
        return True

    while not has_ended(POLL_SECONDS if survives(follower.update) else PAUSE_SECONDS):
        pass
    survives(follower.finish)


@dataclass
class _Followed:
    """A run, the curve points that it has, and when each step was first seen [ms since 1970]."""

    run: Run
    points: dict[Point, float] = field(default_factory=dict)
    times: dict[int, int] = field(default_factory=dict)


class _Follower:
    """Follows the seeds of one agent."""

    def __init__(self, agent: str, root: Path) -> None:
        params = params_file.load(root / "params.yaml")
        self._agent = agent
        self._root = root
        self._seeds = params.seeds
        self._algorithm = params.agent(agent).algorithm
        self._params = records.run_params(root, params, agent)
        self._start = stores.now_ms()
        self._store: Store | None = None
        self._parent: Run | None = None
        self._followed: dict[int, _Followed] = {}
        self._monitor: Monitor | None = None

    def update(self) -> None:
        """Log new points of the curve files, and the machine's load from the first one on."""
        store = self._connect()
        with failures_as_input_errors(store.uri):
            for seed in self._seeds:
                self._follow(store, seed)
            if self._parent is not None and not (self._monitor and self._monitor.is_alive):
                self._monitor = Monitor(self._parent.info.run_id, store.uri)

    def finish(self) -> None:
        """Log the rest, and end the runs: finished if there is a policy, otherwise killed."""
        if self._monitor:
            self._monitor.finish()
        store = self._connect()
        with failures_as_input_errors(store.uri):
            statuses = {self._end(store, seed) for seed in self._seeds}
            if self._parent is not None:
                status = "KILLED" if "KILLED" in statuses else "FINISHED"
                store.client.set_terminated(self._parent.info.run_id, status)
            store.clear_abandoned()

    def _connect(self) -> Store:
        if self._store is None:
            store = stores.connect(self._root, TIMEOUT_SECONDS, MAX_RETRIES)
            with failures_as_input_errors(store.uri):
                store.clear_abandoned()
            self._store = store
        return self._store

    def _follow(self, store: Store, seed: int) -> None:
        curve = reading.read_curve(self._root, self._agent, seed)
        if not curve:
            return
        followed = self._followed.get(seed)
        if followed is not None and _contradicts(followed.points, curve):
            store.client.set_terminated(followed.run.info.run_id, "KILLED")
            followed = None
        if followed is None:
            followed = self._followed[seed] = self._open(store, seed, curve)
        for _, step in curve.keys() - followed.points:  # one resent with its time is no duplicate
            followed.times.setdefault(step, stores.now_ms())
        store.apply(followed.run, Desired(curve=curve, times=followed.times), followed.points)
        followed.points |= curve

    def _open(self, store: Store, seed: int, curve: stores.Points) -> _Followed:
        """Return a run to log to: that of an interrupted training that resumed, or a new one."""
        if self._parent is None:
            self._parent = store.pending_comparison()
            store.take_over(self._parent)
        tags = {stores.LIVE: "true", stores.PARENT: self._parent.info.run_id}
        for run in store.seed_runs(self._agent, seed):
            if not stores.is_unclaimed(run, self._params):
                continue
            points = {point: values[0] for point, values in store.curve_points(run).items()}
            if not _contradicts(points, curve):
                store.take_over(run)
                store.apply(run, Desired(tags=tags))
                return _Followed(run, points)
        run = store.create_seed_run(self._agent, seed, self._algorithm, tags, self._start)
        store.apply(run, Desired(params=self._params))
        return _Followed(run)

    def _end(self, store: Store, seed: int) -> str | None:
        """End a seed's run and return its status; None if it has none, or a redundant one.

        A policy with the same bytes may already have a finished run: then only that one is kept.
        """
        path = Paths(self._root).agent(self._agent).seed(seed).policy
        content = digest(path) if path.exists() else None
        is_shown = content is not None and any(
            stores.shows(run, content, self._params) and run.info.status == "FINISHED"
            for run in store.seed_runs(self._agent, seed)
        )
        if not is_shown:
            self._follow(store, seed)
        if seed not in self._followed:
            return None
        run_id = self._followed[seed].run.info.run_id
        if is_shown:
            store.client.set_terminated(run_id, "KILLED")
            store.client.delete_run(run_id)
            return None
        if content is not None:
            store.client.set_tag(run_id, stores.POLICY_DIGEST, content)
        status = "KILLED" if content is None else "FINISHED"
        store.client.set_terminated(run_id, status)
        return status


def _contradicts(stored: stores.Points, curve: stores.Points) -> bool:
    """Tell whether a curve has another value where a stored one has a point."""
    return any(
        point in stored and not stores.same(stored[point], value) for point, value in curve.items()
    )
