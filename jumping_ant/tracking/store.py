"""What the project looks up and writes in MLflow. A finished run is written once."""

import hashlib
import json
import os
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from mlflow import MlflowClient
from mlflow.entities import LoggedModel, Metric, Param, Run
from mlflow.store.entities import PagedList

from jumping_ant.base import process
from jumping_ant.base.files import digest
from jumping_ant.tracking import connection
from jumping_ant.tracking.internals import UNFOLDED
from jumping_ant.tracking.reading import Point
from jumping_ant.tracking.records import stage

PENDING = "pending"

# Tags. A run of a seed has the first three, a comparison the fourth.
AGENT, SEED, POLICY_DIGEST, COMPARISON = "agent", "seed", "policy_digest", "comparison"
ALGORITHM = "algorithm"
CONTENT = "content_digest"  # of what was written
SETTINGS = "settings_digest"  # of the parameters of all that a comparison compares
LIVE = "live"  # shown while training ran
WRITER = "writer"  # the process that writes the run
PARENT = "mlflow.parentRunId"
HOLD = "hold"  # control steps that each of a model's outputs is held for
GIT_COMMIT, DVC_STAGE, DVC_MD5 = "git_commit", "dvc_stage", "dvc_md5"
SYSTEM = "system/"  # metrics: the load of the machine while training ran
SILENT_DAYS = 1  # a run of another host counts as abandoned if it started longer ago

Points = Mapping[Point, float]
Item = TypeVar("Item")


@dataclass(frozen=True)
class Content:
    """What a finished run shows."""

    name: str
    tags: Mapping[str, str]
    params: Mapping[str, str] = field(default_factory=dict)
    curve: Points = field(default_factory=dict)
    metrics: Mapping[str, float] = field(default_factory=dict)  # without steps
    artifacts: Mapping[str, Path] = field(default_factory=dict)  # files by their path in the run
    status: str = "FINISHED"
    # Not part of the digest: tags that are written once, tags that every call renews, and the times
    # of the begin, the end and each of the curve's steps [ms since 1970].
    aside: Mapping[str, str] = field(default_factory=dict)
    place: Mapping[str, str] = field(default_factory=dict)
    start: int | None = None
    end: int | None = None
    times: Mapping[int, int] = field(default_factory=dict)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of all of it, by which a later call recognises a run that shows the same."""
        files = {name: digest(path) for name, path in self.artifacts.items()}
        told = [self.name, dict(self.tags), dict(self.params), dict(self.metrics), files]
        text = json.dumps([*told, sorted(self.curve.items()), self.status], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


@dataclass(frozen=True)
class Store:
    """An open MLflow store with the project's experiment, and what the project does with it."""

    client: MlflowClient
    experiment_id: str
    uri: str
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

    def create_run(self, name: str, tags: Mapping[str, str], start: int | None = None) -> Run:
        """Create a run that this process writes; it began at `start` [ms since 1970], or now."""
        own = {WRITER: process.this_process()}
        own |= source_tags(tags[DVC_STAGE], self.commit) if DVC_STAGE in tags else {}
        own |= {GIT_COMMIT: self.commit} if self.commit else {}
        return self.client.create_run(self.experiment_id, start, {**tags, **own}, name)

    def pending_comparison(self) -> Run:
        """Return the run that seeds are nested under until every policy is trained."""
        if found := self.comparisons():
            return found[0]
        run = self.create_run("comparison (pending)", {COMPARISON: PENDING})
        self.client.set_terminated(run.info.run_id)
        return run

    def take_over(self, run: Run) -> None:
        """Make this process the writer of a run."""
        self.client.set_tag(run.info.run_id, WRITER, process.this_process())
        self.client.update_run(run.info.run_id, "RUNNING")

    def shown(
        self, content: Content, runs: Sequence[Run], has_all: Callable[[Run], bool] | None = None
    ) -> Run | None:
        """Return the first of some runs that shows a content, in its place; None if none does."""
        for run in runs:
            is_right = run.data.tags.get(CONTENT) == content.digest
            is_right = is_right and run.info.status == content.status
            if is_right and self._has_files(run, content) and (has_all is None or has_all(run)):
                for name, value in changed(run.data.tags, content.place).items():
                    self.client.set_tag(run.info.run_id, name, value)
                return run
        return None

    def write(
        self,
        content: Content,
        log_model: Callable[[Run], str] | None = None,
        load: Sequence[Metric] = (),
    ) -> Run:
        """Write a run; `log_model` returns the id of the model that has its metrics, too."""
        tags = {**content.tags, **content.aside, **content.place, CONTENT: content.digest}
        run = self.create_run(content.name, tags, content.start)
        run_id, start = run.info.run_id, run.info.start_time
        model_id = log_model(run) if log_model else None
        metrics = [Metric(*it, start, 0, model_id) for it in content.metrics.items()]
        params = [Param(*it) for it in content.params.items()]
        self.log_curve(run, content.curve, content.times)
        self.client.log_batch(run_id, [*metrics, *load], params)
        for name, path in content.artifacts.items():
            self.client.log_artifact(run_id, path, os.path.dirname(name) or None)
        self.client.set_terminated(run_id, content.status, content.end)
        return run

    def settle(self, content: Content, runs: Sequence[Run]) -> tuple[Run, bool]:
        """Return the run that shows a content, and whether it was written, in place of others."""
        shown = self.shown(content, runs)
        run = shown or self.write(content, load=next(filter(None, map(self._load, runs)), ()))
        for other in runs:
            if other.info.run_id != run.info.run_id:
                self.client.delete_run(other.info.run_id)
        return run, shown is None

    def log_curve(self, run: Run, curve: Points, times: Mapping[int, int]) -> None:
        """Log points; each has the time of its step [ms since 1970], or now."""
        now = now_ms()
        points = [
            Metric(name, value, times.get(step, now), step) for (name, step), value in curve.items()
        ]
        self.client.log_batch(run.info.run_id, points)

    def _load(self, run: Run) -> list[Metric]:
        """Return the load of the machine that a run has, which no file tells."""
        names = [name for name in run.data.metrics if name.startswith(SYSTEM)]
        histories = [self.client.get_metric_history(run.info.run_id, name) for name in names]
        return [metric for history in histories for metric in history]

    def _has_files(self, run: Run, content: Content) -> bool:
        """Tell whether a run's files are there; they may have been deleted by hand."""
        stored: dict[str, int | None] = {}
        for folder in {os.path.dirname(name) for name in content.artifacts}:
            listed = self.client.list_artifacts(run.info.run_id, folder or None)
            stored |= {entry.path: entry.file_size for entry in listed}
        return not changed(
            stored, {n: path.stat().st_size for n, path in content.artifacts.items()}
        )

    def clear_abandoned(self) -> None:
        """Mark abandoned runs as killed, and delete empty pending comparisons.

        Runs without a writer's name are other people's.
        """
        for run in self.search("attributes.status = 'RUNNING'"):
            if WRITER in run.data.tags and not is_written(run):
                self.client.set_terminated(run.info.run_id, "KILLED")
        for run in self.comparisons():
            if not is_written(run) and not self.search(children_of(run)):
                self.client.delete_run(run.info.run_id)


def connect(
    root: Path, timeout_seconds: int, max_retries: int, experiment: str = connection.EXPERIMENT
) -> Store:
    """Open the store of a project; arguments and errors as in `connection.connect`."""
    opened = connection.connect(root, timeout_seconds, max_retries, experiment)
    return Store(*opened, commit=git_commit(root))


def children_of(run: Run) -> str:
    """Return the condition that runs nested under a run meet."""
    return f"tags.`{PARENT}` = '{run.info.run_id}'"


def changed(stored: Mapping[str, Any], wanted: Mapping[str, Item]) -> dict[str, Item]:
    """Return what is wanted and not stored so."""
    return {name: value for name, value in wanted.items() if stored.get(name) != value}


def seed_tags(agent: str, seed: int, algorithm: str) -> dict[str, str]:
    """Return the tags of each run of an agent and a seed."""
    own = {AGENT: agent, SEED: str(seed), ALGORITHM: algorithm, DVC_STAGE: stage(agent)}
    return own | UNFOLDED


def source_tags(stage: str, commit: str | None) -> dict[str, str]:
    """Return the tags behind MLflow's columns Source and Version."""
    tags = {"mlflow.source.name": stage, "mlflow.source.type": "LOCAL"}
    return tags | ({"mlflow.source.git.commit": commit} if commit else {})


def is_of(run: Run, policy_digest: str, params: Mapping[str, str]) -> bool:
    """Tell whether a run is that of a policy trained with these parameters, or is unfinished.

    Agents that do not learn have the same policy whatever the task. A killed writer may have
    logged none of the parameters.
    """
    is_own = run.info.status != "FINISHED" or run.data.tags.get(POLICY_DIGEST) == policy_digest
    return is_own and bool(run.data.params.items() <= params.items())


def is_written(run: Run) -> bool:
    """Tell whether some process is still writing a run."""
    if run.info.status != "RUNNING":
        return False
    writer = run.data.tags.get(WRITER, "")
    if process.is_of_this_host(writer):
        return process.exists(writer)
    seconds = time.time() - run.info.start_time / 1000
    return bool(writer) and seconds < SILENT_DAYS * 86_400


def is_followed(run: Run) -> bool:
    """Tell whether a run shows a training that has not ended."""
    return LIVE in run.data.tags and is_written(run)


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
