"""Learning curves in MLflow while training runs.

A separate process follows the curve files that training writes, so that training neither waits for
MLflow nor fails with it. `track` replaces these runs by runs written from the files.
"""

import sys
from collections.abc import Callable
from pathlib import Path

from mlflow.entities import Param, Run
from mlflow.utils.time import get_current_time_millis

from jumping_ant.base.errors import InputError, printable
from jumping_ant.base.files import digest
from jumping_ant.base.paths import Paths
from jumping_ant.params.model import Params
from jumping_ant.tracking import records
from jumping_ant.tracking import store as stores
from jumping_ant.tracking.connection import failures_as_input_errors
from jumping_ant.tracking.store import Points, Store

POLL_SECONDS = 5.0  # an MLflow call costs as much as 50 points
PAUSE_SECONDS = 30.0  # after a failure
REST = "training continues, and `track` completes MLflow from the files"


def follow(agent: str, root: Path, params: Params, has_ended: Callable[[float], bool]) -> None:
    """Log the learning curves of an agent's seeds until training with these parameters ends.

    A failure of MLflow is reported once, on standard error, and the update is retried later.
    `has_ended` waits for at most the given seconds and returns whether training has ended.
    """
    follower = _Follower(agent, root, params)
    while not has_ended(POLL_SECONDS if follower.survives(follower.update) else PAUSE_SECONDS):
        pass
    follower.survives(follower.finish)


class _Follower:
    """Follows the seeds of one agent."""

    def __init__(self, agent: str, root: Path, params: Params) -> None:
        self._agent, self._root, self._seeds = agent, root, params.seeds
        self._algorithm = params.agent(agent).algorithm
        self._params = records.run_params(root, params, agent)
        self._start = get_current_time_millis()
        self._store: Store | None = None
        self._followed: dict[int, tuple[Run, Points]] = {}  # by seed, with the points it has
        self._is_reported = False

    def survives(self, step: Callable[[], object]) -> bool:
        """Return whether MLflow takes a step; only the first failure is reported."""
        try:
            step()
        except InputError as error:
            if not self._is_reported:
                warning = printable(f"warning: no live curves: {error}; {REST}")
                print(warning, file=sys.stderr)
            self._is_reported = True
            return False
        return True

    def update(self) -> Store:
        """Log new points of the curve files, and return where they are."""
        store = self._store or stores.connect(self._root, timeout_seconds=5, max_retries=0)
        self._store = store
        with failures_as_input_errors(store.uri):
            for seed in self._seeds:
                self._follow(store, seed)
        return store

    def finish(self) -> None:
        """Log the rest, and end the runs: finished if there is a policy, otherwise killed."""
        store = self.update()
        with failures_as_input_errors(store.uri):
            for seed, (run, _) in self._followed.items():
                policy = self._policy_digest(seed)
                if policy is not None:
                    store.client.set_tag(run.info.run_id, stores.POLICY_DIGEST, policy)
                store.client.set_terminated(run.info.run_id, "FINISHED" if policy else "KILLED")

    def _follow(self, store: Store, seed: int) -> None:
        """Log a seed's new points."""
        curve = records.read_curve(self._root, self._agent, seed)
        run, points = self._followed.get(seed, (None, {}))
        if run is not None and any(curve.get(it, value) != value for it, value in points.items()):
            store.client.delete_run(run.info.run_id)  # another training has begun
            run, points = None, {}
        if curve.keys() <= points.keys() or (run is None and self._is_shown(store, seed)):
            return
        run = run or self._open(store, seed)
        self._followed[seed] = run, points
        new = {point: value for point, value in curve.items() if point not in points}
        store.log_curve(run, new, times={})
        self._followed[seed] = run, curve

    def _policy_digest(self, seed: int) -> str | None:
        path = Paths(self._root).agent(self._agent).seed(seed).policy
        return digest(path) if path.exists() else None

    def _is_shown(self, store: Store, seed: int) -> bool:
        """Tell whether the policy was trained before and has its run."""
        policy = self._policy_digest(seed)
        return policy is not None and any(
            run.info.status == "FINISHED" and stores.is_of(run, policy, self._params)
            for run in store.seed_runs(self._agent, seed)
        )

    def _open(self, store: Store, seed: int) -> Run:
        """Return a new run to log to, in place of that of an interrupted training."""
        for run in store.seed_runs(self._agent, seed):
            if stores.is_of(run, "", self._params) and not stores.is_followed(run):
                store.client.delete_run(run.info.run_id)
        tags = stores.seed_tags(self._agent, seed, self._algorithm) | {stores.LIVE: "true"}
        run = store.create_run(records.run_name(self._agent, seed), tags, self._start)
        params = [Param(*param) for param in self._params.items()]
        store.client.log_batch(run.info.run_id, params=params)
        return run
