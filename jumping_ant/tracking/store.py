"""What the project writes to MLflow and looks up there. A finished run is written once."""

import hashlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import mlflow
from mlflow import MlflowClient
from mlflow.entities import LoggedModel, Metric, Param, Run
from mlflow.utils.time import get_current_time_millis

from jumping_ant.base import process
from jumping_ant.base.files import digest
from jumping_ant.tracking import connection
from jumping_ant.tracking.pages import UNFOLDED
from jumping_ant.tracking.records import Point, stage

EXPERIMENT = "jumping-ant"
# Tags.
AGENT, SEED, ALGORITHM, POLICY_DIGEST = "agent", "seed", "algorithm", "policy_digest"
COMPARISON = "comparison"  # its key
CONTENT = "content_digest"  # of what was written
LIVE = "live"  # shown while training ran
WRITER = "writer"  # the process that writes the run
PARENT = "mlflow.parentRunId"
HOLD = "hold"  # control steps that each of a model's outputs is held for
GIT_COMMIT, DVC_STAGE, DVC_MD5 = "git_commit", "dvc_stage", "dvc_md5"

Points = Mapping[Point, float]


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
    # of the start, the end and each of the curve's steps [ms since 1970].
    aside: Mapping[str, str] = field(default_factory=dict)
    place: Mapping[str, str] = field(default_factory=dict)
    start: int | None = None
    end: int | None = None
    times: Mapping[int, int] = field(default_factory=dict)
    commit: str | None = None  # that holds it, named as soon as there is one

    @cached_property
    def digest(self) -> str:
        """SHA-256 of all of it, by which a later call recognises a run that shows the same."""
        files = {name: digest(_content(path)) for name, path in self.artifacts.items()}
        shown = [self.name, dict(self.tags), dict(self.params), dict(self.metrics), files]
        text = json.dumps([*shown, sorted(self.curve.items()), self.status], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


@dataclass(frozen=True)
class Store:
    """An open MLflow store with an experiment of the project."""

    client: MlflowClient
    experiment_id: str
    uri: str

    def search(self, condition: str) -> list[Run]:
        """Return the runs of the experiment that meet a condition, newest first."""
        return mlflow.search_runs([self.experiment_id], condition, output_format="list")

    def seed_runs(self, agent: str, seed: int) -> list[Run]:
        """Return the runs of an agent and a seed, newest first."""
        return self.search(f"tags.{AGENT} = '{agent}' and tags.{SEED} = '{seed}'")

    def logged_models(self, condition: str) -> list[LoggedModel]:
        """Return the models of the experiment that meet a condition."""
        return mlflow.search_logged_models([self.experiment_id], condition, output_format="list")

    def create_run(self, name: str, tags: Mapping[str, str], start: int | None = None) -> Run:
        """Create a run that this process writes; it began at `start` [ms since 1970], or now."""
        more = {WRITER: process.this_process()}
        more |= source_tags(tags[DVC_STAGE]) if DVC_STAGE in tags else {}
        return self.client.create_run(self.experiment_id, start, {**tags, **more}, name)

    def settle(
        self,
        content: Content,
        runs: Sequence[Run],
        has_model: Callable[[Run], bool] = lambda _: True,
        log_model: Callable[[Run], str] | None = None,
    ) -> tuple[Run, str]:
        """Have a content shown by one run, and delete the other `runs` that earlier calls wrote.

        A run that lacks its model counts as different; `log_model` returns the id of a new one.
        Returns the run, and whether it was `created`, `replaced` another, or is `unchanged`.
        """
        run = next((it for it in runs if self._shows(it, content) and has_model(it)), None)
        verb = "unchanged" if run else "replaced" if runs else "created"
        if run is None:
            run = self._write(content, log_model)
        place = dict(content.place)
        if content.commit and is_without_commit(run):
            place |= {GIT_COMMIT: content.commit, "mlflow.source.git.commit": content.commit}
        for name, value in changed(run.data.tags, place).items():
            self.client.set_tag(run.info.run_id, name, value)
        for other in runs:
            if other.info.run_id != run.info.run_id:
                self.client.delete_run(other.info.run_id)
        return run, verb

    def _write(self, content: Content, log_model: Callable[[Run], str] | None) -> Run:
        tags = {**content.tags, **content.aside, **content.place, CONTENT: content.digest}
        run = self.create_run(content.name, tags, content.start)
        run_id, start = run.info.run_id, run.info.start_time
        model_id = log_model(run) if log_model else None
        metrics = [Metric(*it, start, 0, model_id) for it in content.metrics.items()]
        self.log_curve(run, content.curve, content.times)
        self.client.log_batch(run_id, metrics, [Param(*it) for it in content.params.items()])
        for name, path in content.artifacts.items():
            self.client.log_artifact(run_id, path, os.path.dirname(name) or None)
        self.client.set_terminated(run_id, content.status, content.end)
        return run

    def log_curve(self, run: Run, curve: Points, times: Mapping[int, int]) -> None:
        """Log points; each has the time of its step [ms since 1970], or now."""
        now = get_current_time_millis()
        points = [
            Metric(name, it, times.get(step, now), step) for (name, step), it in curve.items()
        ]
        self.client.log_batch(run.info.run_id, points)

    def _shows(self, run: Run, content: Content) -> bool:
        """Tell whether a run shows a content, with files that nobody has deleted by hand."""
        if (run.data.tags.get(CONTENT), run.info.status) != (content.digest, content.status):
            return False
        stored: dict[str, int | None] = {}
        for folder in {os.path.dirname(name) for name in content.artifacts}:
            listed = self.client.list_artifacts(run.info.run_id, folder or None)
            stored |= {entry.path: entry.file_size for entry in listed}
        return all(stored.get(name) == it.stat().st_size for name, it in content.artifacts.items())

    def close_abandoned(self) -> None:
        """Mark the runs of ended processes as killed."""
        for run in self.search("attributes.status = 'RUNNING'"):
            writer = run.data.tags.get(WRITER, "")
            if process.is_of_this_host(writer) and not process.exists(writer):
                self.client.set_terminated(run.info.run_id, "KILLED")


def connect(
    root: Path, experiment: str = EXPERIMENT, timeout_seconds: int = 20, max_retries: int = 1
) -> Store:
    """Open the store of a project; one that cannot be opened is an InputError."""
    opened = connection.connect(root, experiment, timeout_seconds, max_retries)
    return Store(*opened)


def changed(stored: Mapping[str, str], wanted: Mapping[str, str]) -> dict[str, str]:
    """Return the tags that are wanted and not stored so."""
    return {name: value for name, value in wanted.items() if stored.get(name) != value}


def seed_tags(agent: str, seed: int, algorithm: str) -> dict[str, str]:
    """Return the tags of each run of an agent and a seed."""
    tags = {AGENT: agent, SEED: str(seed), ALGORITHM: algorithm, DVC_STAGE: stage(agent)}
    return tags | UNFOLDED


def source_tags(stage: str) -> dict[str, str]:
    """Return the tags behind MLflow's column Source."""
    return {"mlflow.source.name": stage, "mlflow.source.type": "LOCAL"}


def is_without_commit(run: Run) -> bool:
    """Tell whether a run names no commit yet."""
    return GIT_COMMIT not in run.data.tags


def _content(path: Path) -> Path:
    """Return the file that says what is in a file: Rerun draws a recording's ids anew."""
    recorded = path.parent / "digests" / f"{path.stem}.json"
    return recorded if path.suffix == ".rrd" and recorded.exists() else path


def is_of(run: Run, policy_digest: str, params: Mapping[str, str]) -> bool:
    """Tell whether a run is that of a policy trained with these parameters, or is unfinished.

    Agents that do not learn have one policy for all tasks; a killed writer logged some parameters.
    """
    fits = run.info.status != "FINISHED" or run.data.tags.get(POLICY_DIGEST) == policy_digest
    return fits and bool(run.data.params.items() <= params.items())


def is_followed(run: Run) -> bool:
    """Tell whether a process of this host logs a training to a run."""
    writer = run.data.tags.get(WRITER, "")
    is_live = LIVE in run.data.tags and run.info.status == "RUNNING"
    return is_live and process.is_of_this_host(writer) and process.exists(writer)
