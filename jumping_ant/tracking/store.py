"""What the project looks up and writes in MLflow: runs, curves, artifacts, models."""

import json
import os
import subprocess
import time
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from mlflow.entities import LoggedModel, Metric, Param, Run, RunTag
from mlflow.store.entities import PagedList

from jumping_ant.base.files import digest
from jumping_ant.base.process import this_process
from jumping_ant.tracking import connection
from jumping_ant.tracking.connection import Connection
from jumping_ant.tracking.internals import UNFOLDED
from jumping_ant.tracking.reading import Point
from jumping_ant.tracking.records import AGGREGATE, is_of_curve, run_name, stage
from jumping_ant.tracking.writers import WRITER, is_written

PENDING = "pending"

# Tags. A run of a seed has the first three, a comparison the fourth.
AGENT, SEED, POLICY_DIGEST, COMPARISON = "agent", "seed", "policy_digest", "comparison"
ALGORITHM = "algorithm"
LIVE = "live"  # written while training ran
ARTIFACTS = "artifact_digests"
PARENT = "mlflow.parentRunId"
HOLD = "hold"  # control steps that each of a model's outputs is held for
GIT_COMMIT, DVC_STAGE, DVC_MD5 = "git_commit", "dvc_stage", "dvc_md5"

Points = Mapping[Point, float]
Item = TypeVar("Item")


@dataclass(frozen=True)
class Desired:
    """What a run should show."""

    params: Mapping[str, str] = field(default_factory=dict)  # MLflow never changes one
    curve: Points = field(default_factory=dict)
    times: Mapping[int, int] = field(default_factory=dict)  # of the curve's steps [ms since 1970]
    metrics: Mapping[str, float] = field(default_factory=dict)  # without steps
    tags: Mapping[str, str] = field(default_factory=dict)
    artifacts: Mapping[str, Path] = field(default_factory=dict)  # files by their path in the run
    model: LoggedModel | None = None  # has the metrics, too


@dataclass(frozen=True)
class Store(Connection):
    """An open MLflow store, and what the project does with it."""

    commit: str | None  # the project's in git; None outside of a repository

    def search(self, condition: str) -> list[Run]:
        """Return the runs of the experiment that meet a condition, newest first."""
        return _all(
            lambda token: self.client.search_runs([self.experiment_id], condition, page_token=token)
        )

    def logged_models(self, agent: str) -> list[LoggedModel]:
        """Return the models of an agent, newest first."""
        experiments, condition = [self.experiment_id], f"tags.{AGENT} = '{agent}'"
        return _all(
            lambda token: self.client.search_logged_models(experiments, condition, page_token=token)
        )

    def seed_runs(self, agent: str, seed: int) -> list[Run]:
        """Return the runs of an agent and a seed, newest first."""
        return self.search(f"tags.{AGENT} = '{agent}' and tags.{SEED} = '{seed}'")

    def comparisons(self, key: str = PENDING) -> list[Run]:
        """Return the comparisons with a key, newest first."""
        return self.search(f"tags.{COMPARISON} = '{key}'")

    def aggregates(self, key: str, agent: str) -> list[Run]:
        """Return the runs of all seeds of an agent in a comparison, newest first."""
        return self.search(f"tags.{AGGREGATE} = '{key}' and tags.{AGENT} = '{agent}'")

    def children(self, run: Run) -> list[Run]:
        """Return the runs nested under a run."""
        return self.search(f"tags.`{PARENT}` = '{run.info.run_id}'")

    def create_run(self, name: str, tags: Mapping[str, str], start: int | None = None) -> Run:
        """Create a run that this process writes; it began at `start` [ms since 1970], or now."""
        return self.client.create_run(self.experiment_id, start, self._first_tags(tags), name)

    def create_seed_run(
        self, agent: str, seed: int, algorithm: str, tags: Mapping[str, str], start: int
    ) -> Run:
        """Create the run of an agent and a seed; arguments as in `create_run`."""
        own = {AGENT: agent, SEED: str(seed), ALGORITHM: algorithm, DVC_STAGE: stage(agent)}
        return self.create_run(run_name(agent, seed), {**own, **UNFOLDED, **tags}, start)

    def pending_comparison(self) -> Run:
        """Return the run that seeds are nested under until every policy is trained."""
        found = self.comparisons()
        return found[0] if found else self.create_run("comparison (pending)", {COMPARISON: PENDING})

    def rename(self, run: Run, name: str, tags: Mapping[str, str]) -> Run:
        """Make a run one that `create_run` would have created."""
        self.client.update_run(run.info.run_id, "RUNNING", name)
        self.apply(run, Desired(tags=self._first_tags(tags)))
        return self.client.get_run(run.info.run_id)

    def take_over(self, run: Run) -> None:
        """Make this process the writer of a run."""
        self.client.set_tag(run.info.run_id, WRITER, this_process())
        self.client.update_run(run.info.run_id, "RUNNING")

    def curve_points(self, run: Run) -> dict[Point, list[float]]:
        """Return every value of a run's learning curve, without its other metrics."""
        points: dict[Point, list[float]] = {}
        for name in filter(is_of_curve, run.data.metrics):
            for metric in self.client.get_metric_history(run.info.run_id, name):
                points.setdefault((name, metric.step), []).append(metric.value)
        return points

    def apply(self, run: Run, desired: Desired, curve: Container[Point] = ()) -> dict[str, int]:
        """Write what a run lacks or has otherwise, but for stored points; count it by kind."""
        now = now_ms()
        points = [
            Metric(name, value, desired.times.get(step, now), step)
            for (name, step), value in desired.curve.items()
            if (name, step) not in curve
        ]
        metrics = self._changed_metrics(run, desired)
        params = [
            Param(*param) for param in desired.params.items() if param[0] not in run.data.params
        ]
        tags = [RunTag(*tag) for tag in changed(run.data.tags, desired.tags).items()]
        self.client.log_batch(run.info.run_id, points + metrics, params, tags)
        return {
            "curve points": len(points),
            "params": len(params),
            "metrics": len(metrics),
            "artifacts": self._upload(run, desired.artifacts),
            "tags": len(tags),
        }

    def _changed_metrics(self, run: Run, desired: Desired) -> list[Metric]:
        """Return the metrics whose latest value differs, in the run or in its model.

        A first value has the time of the run's start: two processes that log it at once log the
        same. MLflow takes a model's values with a run's; one resent with its time is no duplicate.
        """
        model = desired.model
        shown = _latest(model) if model else desired.metrics
        metrics = []
        for name, value in desired.metrics.items():
            latest, is_shown = run.data.metrics.get(name), same(shown.get(name), value)
            if same(latest, value) and is_shown:
                continue
            time_ms = run.info.start_time if latest is None else now_ms()
            if same(latest, value):
                history = self.client.get_metric_history(run.info.run_id, name)
                time_ms = max(metric.timestamp for metric in history)
            model_id = None if is_shown or model is None else model.model_id
            metrics.append(Metric(name, value, time_ms, 0, model_id))
        return metrics

    def _upload(self, run: Run, artifacts: Mapping[str, Path]) -> int:
        """Upload the files that a run lacks or holds with other content, and count them."""
        run_id = run.info.run_id
        sizes: dict[str, int | None] = {}
        for folder in {os.path.dirname(name) for name in artifacts}:
            listed = self.client.list_artifacts(run_id, folder or None)
            sizes |= {entry.path: entry.file_size for entry in listed}
        digests = json.loads(run.data.tags.get(ARTIFACTS, "{}"))
        stored = {name: (size, digests.get(name)) for name, size in sizes.items()}
        wanted = {
            name: (path.stat().st_size, digest(path)[:16]) for name, path in artifacts.items()
        }
        uploads = changed(stored, wanted)
        for name, (_, content) in uploads.items():
            self.client.log_artifact(run_id, artifacts[name], os.path.dirname(name) or None)
            digests[name] = content
        if uploads:
            self.client.set_tag(run_id, ARTIFACTS, json.dumps(digests))
        return len(uploads)

    def clear_abandoned(self) -> None:
        """Mark abandoned runs as killed, and delete empty pending comparisons.

        Runs without a writer's name are other people's.
        """
        for run in self.search("attributes.status = 'RUNNING'"):
            if WRITER in run.data.tags and not is_written(run):
                self.client.set_terminated(run.info.run_id, "KILLED")
        for run in self.comparisons():
            if not is_written(run) and not self.children(run):
                self.client.delete_run(run.info.run_id)

    def _first_tags(self, tags: Mapping[str, str]) -> dict[str, str]:
        """Return the tags of a new run, and those that say who writes it from which code."""
        own = {WRITER: this_process()} | ({GIT_COMMIT: self.commit} if self.commit else {})
        source = source_tags(tags[DVC_STAGE], self.commit) if DVC_STAGE in tags else {}
        return {**tags, **own, **source}


def connect(
    root: Path, timeout_seconds: int, max_retries: int, experiment: str = connection.EXPERIMENT
) -> Store:
    """Open the store of a project; arguments and errors as in `connection.connect`."""
    opened = connection.connect(root, timeout_seconds, max_retries, experiment)
    return Store(**vars(opened), commit=git_commit(root))


def changed(stored: Mapping[str, Any], wanted: Mapping[str, Item]) -> dict[str, Item]:
    """Return what is wanted and not stored so."""
    return {name: value for name, value in wanted.items() if stored.get(name) != value}


def source_tags(stage: str, commit: str | None) -> dict[str, str]:
    """Return the tags behind MLflow's columns Source and Version."""
    tags = {"mlflow.source.name": stage, "mlflow.source.type": "LOCAL"}
    return tags | ({"mlflow.source.git.commit": commit} if commit else {})


def same(stored: float | None, value: float) -> bool:
    """Tell whether a stored number equals this one, up to the rounding of databases."""
    return stored is not None and abs(stored - value) <= 1e-9 * max(abs(stored), abs(value))


def is_pending(run: Run) -> bool:
    """Tell whether a run is a pending comparison."""
    return run.data.tags.get(COMPARISON) == PENDING


def shows(run: Run, policy_digest: str, params: Mapping[str, str]) -> bool:
    """Tell whether a run is that of a policy file, trained with these parameters.

    Agents that do not learn have the same policy whatever the task.
    """
    return run.data.tags.get(POLICY_DIGEST) == policy_digest and _has_only(run, params)


def is_unclaimed(run: Run, params: Mapping[str, str]) -> bool:
    """Tell whether a run comes from a training with these parameters that was interrupted."""
    tags = run.data.tags
    is_interrupted = LIVE in tags and POLICY_DIGEST not in tags and not is_written(run)
    return is_interrupted and _has_only(run, params)


def now_ms() -> int:
    """Return the time [ms since 1970]."""
    return time.time_ns() // 1_000_000


def git_commit(root: Path) -> str | None:
    """Return the project's commit; None outside of a git repository, or before the first."""
    command = ["git", "-C", str(root), "rev-parse", "--verify", "--quiet", "HEAD"]
    try:
        return subprocess.run(command, capture_output=True, text=True).stdout.strip() or None
    except OSError:
        return None


def _all(page_of: Callable[[str | None], PagedList[Item]]) -> list[Item]:
    """Return what all pages of a search list."""
    page = page_of(None)
    found = list(page)
    while page.token:
        page = page_of(page.token)
        found += page
    return found


def _has_only(run: Run, params: Mapping[str, str]) -> bool:
    """Tell whether a run has none but these parameters; a killed writer may have logged a few."""
    return bool(run.data.params.items() <= params.items())


def _latest(model: LoggedModel) -> dict[str, float]:
    ordered = sorted(model.metrics or [], key=lambda metric: metric.timestamp)
    return {metric.key: metric.value for metric in ordered}
