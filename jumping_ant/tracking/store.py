"""What the project looks up and writes in MLflow: runs, curves, artifacts, models."""

import json
import subprocess
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mlflow.entities import LoggedModel, Metric, Param, Run, RunTag

from jumping_ant.base.files import digest
from jumping_ant.tracking import connection, pages
from jumping_ant.tracking.connection import Connection
from jumping_ant.tracking.reading import Point
from jumping_ant.tracking.records import is_of_curve, run_name, stage
from jumping_ant.tracking.writers import WRITER, is_written, this_process

PENDING = "pending"

# Tags. A run of a seed has the first three, a comparison the fourth.
AGENT, SEED, POLICY_DIGEST, COMPARISON = "agent", "seed", "policy_digest", "comparison"
ALGORITHM = "algorithm"
LIVE = "live"  # written while training ran
ARTIFACTS = "artifact_digests"
PARENT = "mlflow.parentRunId"
HOLD = "hold"  # control steps that each of a model's outputs is held for
GIT_COMMIT, DVC_STAGE, DVC_MD5 = "git_commit", "dvc_stage", "dvc_md5"

MAX_METRICS_PER_CALL = 1000

Points = Mapping[Point, float]


@dataclass(frozen=True)
class Store(Connection):
    """An open MLflow store, and what the project does with it.

    Attributes:
        commit: The project's git commit; None outside of a repository.
    """

    commit: str | None

    def search(self, condition: str) -> list[Run]:
        """Return the runs of the experiment that meet a condition, newest first."""
        runs: list[Run] = []
        token: str | None = None
        while True:
            page = self.client.search_runs([self.experiment_id], condition, page_token=token)
            runs += page
            token = page.token
            if not token:
                return runs

    def seed_runs(self, agent: str, seed: int) -> list[Run]:
        """Return the runs of an agent and a seed, newest first."""
        return self.search(f"tags.{AGENT} = '{agent}' and tags.{SEED} = '{seed}'")

    def children(self, run: Run) -> list[Run]:
        """Return the runs nested under a run."""
        return self.search(f"tags.`{PARENT}` = '{run.info.run_id}'")

    def create_run(self, name: str, tags: Mapping[str, str], start: int | None = None) -> Run:
        """Create a run that this process writes.

        Args:
            name: The run's name.
            tags: The run's tags.
            start: When it began [ms since 1970]; by default now.
        """
        own = {WRITER: this_process()} | ({GIT_COMMIT: self.commit} if self.commit else {})
        if DVC_STAGE in tags:
            own |= source_tags(tags[DVC_STAGE], self.commit)
        return self.client.create_run(self.experiment_id, start, {**tags, **own}, name)

    def create_seed_run(
        self, agent: str, seed: int, algorithm: str, tags: Mapping[str, str], start: int
    ) -> Run:
        """Create the run of an agent and a seed; arguments as in `create_run`."""
        own = {AGENT: agent, SEED: str(seed), ALGORITHM: algorithm, DVC_STAGE: stage(agent)}
        return self.create_run(run_name(agent, seed), {**own, **pages.UNFOLDED, **tags}, start)

    def pending_comparison(self) -> Run:
        """Return the run that seeds are nested under until every policy is trained."""
        found = self.search(f"tags.{COMPARISON} = '{PENDING}'")
        return found[0] if found else self.create_run("comparison (pending)", {COMPARISON: PENDING})

    def curve_points(self, run: Run) -> dict[Point, list[float]]:
        """Return every value of a run's learning curve, without its other metrics."""
        points: dict[Point, list[float]] = {}
        for name in filter(is_of_curve, run.data.metrics):
            for metric in self.client.get_metric_history(run.info.run_id, name):
                points.setdefault((name, metric.step), []).append(metric.value)
        return points

    def log_points(self, run_id: str, points: Points, times: Mapping[int, int]) -> None:
        """Log points of a learning curve; arguments as in `as_metrics`."""
        self.log_metrics(run_id, as_metrics(points, times))

    def log_metrics(self, run_id: str, metrics: Sequence[Metric]) -> None:
        """Log metrics in as few calls as possible."""
        for first in range(0, len(metrics), MAX_METRICS_PER_CALL):
            batch = metrics[first : first + MAX_METRICS_PER_CALL]
            self.client.log_batch(run_id, metrics=batch, synchronous=True)

    def logged_models(self, agent: str) -> list[LoggedModel]:
        """Return the models of an agent, newest first."""
        models: list[LoggedModel] = []
        token: str | None = None
        while True:
            page = self.client.search_logged_models(
                [self.experiment_id], f"tags.{AGENT} = '{agent}'", page_token=token
            )
            models += page
            token = page.token
            if not token:
                return models

    def log_missing_params(self, run: Run, params: Mapping[str, str]) -> int:
        """Log the parameters that a run lacks (MLflow never changes one), and count them."""
        missing = [
            Param(name, value) for name, value in params.items() if name not in run.data.params
        ]
        if missing:
            self.client.log_batch(run.info.run_id, params=missing, synchronous=True)
        return len(missing)

    def log_changed_summary(
        self, run: Run, summary: Points, model: LoggedModel | None = None
    ) -> int:
        """Log the metrics whose latest value differs, and count them.

        A first value has the time of the run's start: two processes that log it at once log the
        same. MLflow takes a model's values with a run's; one resent with its time is no duplicate.

        Args:
            run: The run.
            summary: The values.
            model: A model that has the same metrics.
        """
        shown = _latest(model.metrics or []) if model else {}
        metrics = []
        for (name, step), value in summary.items():
            model_id = model.model_id if model and not same(shown.get(name), value) else None
            if model_id or not same(run.data.metrics.get(name), value):
                time_ms = self._time_of(run, name, value)
                metrics.append(Metric(name, value, time_ms, step, model_id))
        self.log_metrics(run.info.run_id, metrics)
        return len(metrics)

    def _time_of(self, run: Run, name: str, value: float) -> int:
        """Return the time to log a value of a run's metric with."""
        latest = run.data.metrics.get(name)
        if latest is None:
            return int(run.info.start_time)
        if not same(latest, value):
            return now_ms()
        history = self.client.get_metric_history(run.info.run_id, name)
        return max(metric.timestamp for metric in history)

    def set_changed_tags(self, run: Run, tags: Mapping[str, str]) -> int:
        """Set the tags whose value differs, and count them."""
        changed = [RunTag(*tag) for tag in tags.items() if run.data.tags.get(tag[0]) != tag[1]]
        if changed:
            self.client.log_batch(run.info.run_id, tags=changed, synchronous=True)
        return len(changed)

    def upload_changed(self, run: Run, artifacts: Mapping[str, Path]) -> int:
        """Upload the files that a run lacks or holds with other content, and count them."""
        run_id = run.info.run_id
        sizes: dict[str, int | None] = {}
        for folder in {str(Path(name).parent).removeprefix(".") for name in artifacts}:
            listed = self.client.list_artifacts(run_id, folder or None)
            sizes |= {entry.path: entry.file_size for entry in listed}
        digests = json.loads(run.data.tags.get(ARTIFACTS, "{}"))
        count = 0
        for name, path in artifacts.items():
            content = digest(path)[:16]
            if sizes.get(name) == path.stat().st_size and digests.get(name) == content:
                continue
            folder = str(Path(name).parent).removeprefix(".")
            self.client.log_artifact(run_id, str(path), folder or None)
            digests[name] = content
            count += 1
        if count:
            self.client.set_tag(run_id, ARTIFACTS, json.dumps(digests))
        return count

    def clear_abandoned(self) -> None:
        """Mark abandoned runs as killed, and delete empty pending comparisons."""
        for run in self.search("attributes.status = 'RUNNING'"):
            if not is_written(run):
                self.client.set_terminated(run.info.run_id, "KILLED")
        for run in self.search(f"tags.{COMPARISON} = '{PENDING}'"):
            if not is_written(run) and not self.children(run):
                self.client.delete_run(run.info.run_id)

    def take_over(self, run: Run) -> None:
        """Make this process the writer of a run."""
        self.client.set_tag(run.info.run_id, WRITER, this_process())
        self.client.update_run(run.info.run_id, "RUNNING")


def connect(root: Path, timeout_seconds: int, max_retries: int) -> Store:
    """Open the store of a project; arguments and errors as in `connection.connect`."""
    opened = connection.connect(root, timeout_seconds, max_retries)
    return Store(**vars(opened), commit=git_commit(root))


def as_metrics(points: Points, times: Mapping[int, int]) -> list[Metric]:
    """Return points of a learning curve as MLflow's metrics.

    Args:
        points: Values by name and step.
        times: Time of the steps [ms since 1970]; missing ones get the current time.
    """
    now = now_ms()
    return [
        Metric(name, value, times.get(step, now), step) for (name, step), value in points.items()
    ]


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


def shows(run: Run, policy_digest: str) -> bool:
    """Tell whether a run is that of a policy file."""
    return bool(run.data.tags.get(POLICY_DIGEST) == policy_digest)


def is_unclaimed(run: Run, params: Mapping[str, str]) -> bool:
    """Tell whether a run comes from a training with these parameters that was interrupted."""
    tags = run.data.tags
    is_interrupted = LIVE in tags and POLICY_DIGEST not in tags and not is_written(run)
    return is_interrupted and run.data.params.items() <= params.items()


def now_ms() -> int:
    """Return the time [ms since 1970]."""
    return time.time_ns() // 1_000_000


def git_commit(root: Path) -> str | None:
    """Return the project's commit; None outside of a git repository, or before the first."""
    try:
        found = subprocess.run(
            ["git", "rev-parse", "HEAD"],
            cwd=root,
            capture_output=True,
            encoding="utf-8",
            check=True,
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return found.stdout.strip()


def _latest(metrics: Iterable[Metric]) -> dict[str, float]:
    ordered = sorted(metrics, key=lambda metric: metric.timestamp)
    return {metric.key: metric.value for metric in ordered}
