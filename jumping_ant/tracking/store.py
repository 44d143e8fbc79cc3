"""The MLflow store: where it is, how runs are found and written, and what its failures become."""

import fcntl
import json
import logging
import os
import re
import socket
import sqlite3
import subprocess
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import mlflow
import psutil  # type: ignore[import-untyped]
import requests
from mlflow import MlflowClient
from mlflow.entities import LoggedModel, Metric, Param, Run, RunTag
from mlflow.exceptions import MlflowException
from sqlalchemy.exc import SQLAlchemyError

from jumping_ant.errors import InputError
from jumping_ant.files import PROJECT_ROOT, digest
from jumping_ant.tracking import pages
from jumping_ant.tracking.records import Point, is_of_curve, run_name, stage

# MLflow neither phones home nor chats; whoever wants it to sets these.
os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
os.environ.setdefault("MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT", "true")
os.environ.setdefault("MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR", "false")
if "MLFLOW_LOGGING_LEVEL" not in os.environ:
    logging.getLogger("mlflow").setLevel(logging.ERROR)
    logging.getLogger("urllib3").setLevel(logging.ERROR)  # tells of every retry

EXPERIMENT = "jumping-ant"
PENDING = "pending"

# Tags. A run of a seed has the first three, a comparison the fourth.
AGENT, SEED, POLICY_DIGEST, COMPARISON = "agent", "seed", "policy_digest", "comparison"
ALGORITHM = "algorithm"
LIVE = "live"  # written while training ran
WRITER = "writer"  # the process that writes the run: host, process id, when the process started
ARTIFACTS = "artifact_digests"
PARENT = "mlflow.parentRunId"
GIT_COMMIT, DVC_STAGE, DVC_MD5 = "git_commit", "dvc_stage", "dvc_md5"

MAX_METRICS_PER_CALL = 1000
SILENT_DAYS = 1  # a run of another host is given up if it began longer ago than this
LONGEST_MESSAGE = 300

Points = Mapping[Point, float]


def tracking_uri(root: Path = PROJECT_ROOT) -> str:
    """Return `MLFLOW_TRACKING_URI`, or the database in the project folder."""
    return os.environ.get("MLFLOW_TRACKING_URI") or f"sqlite:///{home(root)}/mlflow.db"


def home(root: Path) -> Path:
    """Return the project folder, also from a folder where DVC runs an experiment.

    `dvc exp run --temp` and `--queue` run in `.dvc/tmp/exps/` and delete that folder afterwards.
    """
    root = root.resolve()
    for parent in root.parents:
        if parent.parts[-3:] == (".dvc", "tmp", "exps"):
            return parent.parents[2]
    return root


SIGNS_OF_CONFLICT = ("UNIQUE constraint failed", "duplicate key", "database is locked")


class ConflictError(InputError):
    """Two processes wrote the same thing at once, and the database took the other's."""


@contextmanager
def failures_as_input_errors(uri: str) -> Iterator[None]:
    """Turn whatever MLflow and its database raise into one line.

    Raises:
        ConflictError: Another process wrote the same thing in the same moment.
        InputError: MLflow failed.
    """
    try:
        yield
    except (MlflowException, SQLAlchemyError, OSError) as error:
        is_conflict = any(sign in str(error) for sign in SIGNS_OF_CONFLICT)
        kind = ConflictError if is_conflict else InputError
        raise kind(f"MLflow at {_without_password(uri)}: {_explain(error)}") from error


def connect(root: Path, timeout_seconds: int, max_retries: int) -> "Store":
    """Open the store and the project's experiment, made if need be.

    Args:
        root: The project folder.
        timeout_seconds: How long an HTTP request may wait for an answer.
        max_retries: How often a failed HTTP request is sent again.

    Raises:
        InputError: It cannot be reached, or is not a store of this project.
    """
    uri = tracking_uri(root)
    os.environ.setdefault("MLFLOW_HTTP_REQUEST_TIMEOUT", str(timeout_seconds))
    os.environ.setdefault("MLFLOW_HTTP_REQUEST_MAX_RETRIES", str(max_retries))
    # It would show a traceback of what it raises, which is told in one line.
    logging.getLogger("mlflow.store.db.utils").setLevel(logging.CRITICAL)
    with failures_as_input_errors(uri), _opened_alone(uri):
        is_given = "MLFLOW_TRACKING_URI" in os.environ
        mlflow.set_tracking_uri(uri)  # the model registry asks for it
        if not is_given:
            os.environ.pop("MLFLOW_TRACKING_URI", None)  # set, too, but another root has another
        client = MlflowClient(uri)
        experiment_id = _experiment_id(client, uri, home(root))
    return Store(client, experiment_id, uri, git_commit(root))


@dataclass(frozen=True)
class Store:
    """An open MLflow store.

    Attributes:
        client: MLflow's client.
        experiment_id: The project's experiment.
        uri: The tracking URI.
        commit: The project's git commit; None outside of a repository.
    """

    client: MlflowClient
    experiment_id: str
    uri: str
    commit: str | None

    @property
    def name(self) -> str:
        """The tracking URI, without a password."""
        return _without_password(self.uri)

    @property
    def is_server(self) -> bool:
        """Whether it is a server, which shows pages and decides where artifacts go."""
        return _is_server(self.uri)

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
        own = {WRITER: _this_process()} | ({GIT_COMMIT: self.commit} if self.commit else {})
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
        """Return every value of a run's learning curve, its other metrics left out."""
        points: dict[Point, list[float]] = {}
        for name in filter(is_of_curve, run.data.metrics):
            for metric in self.client.get_metric_history(run.info.run_id, name):
                points.setdefault((name, metric.step), []).append(metric.value)
        return points

    def log_points(self, run_id: str, points: Points, times: Mapping[int, int]) -> None:
        """Log points of a learning curve; arguments as in `as_metrics`."""
        self.log_metrics(run_id, as_metrics(points, times))

    def log_metrics(self, run_id: str, metrics: Sequence[Metric]) -> None:
        """Log metrics in as few calls as it takes."""
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
        """Log the metrics whose latest value is another, and count them.

        A first value has the time of the run's start: two processes that log it at once log the
        same. MLflow takes values of a model with a run's; sent again with its time, that stays one.

        Args:
            run: The run.
            summary: The values.
            model: A model that they are the metrics of, too.
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
        """Set the tags whose value is another, and count them."""
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
        """Mark as killed what a process left running, and delete pending comparisons of nothing."""
        for run in self.search("attributes.status = 'RUNNING'"):
            if not is_written(run):
                self.client.set_terminated(run.info.run_id, "KILLED")
        for run in self.search(f"tags.{COMPARISON} = '{PENDING}'"):
            if not is_written(run) and not self.children(run):
                self.client.delete_run(run.info.run_id)

    def take_over(self, run: Run) -> None:
        """Make a run one that this process writes."""
        self.client.set_tag(run.info.run_id, WRITER, _this_process())
        self.client.update_run(run.info.run_id, "RUNNING")


def as_metrics(points: Points, times: Mapping[int, int]) -> list[Metric]:
    """Return points of a learning curve as MLflow's metrics.

    Args:
        points: Values by name and step.
        times: Time of the steps [ms since 1970]; now for those that are not there.
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
    """Tell whether a stored number is this one, up to what databases round."""
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


def is_written(run: Run) -> bool:
    """Tell whether some process is still writing a run."""
    if run.info.status != "RUNNING":
        return False
    host, _, process = run.data.tags.get(WRITER, "").partition(" ")
    if host == socket.gethostname():
        return _exists(process)
    return bool(host) and now_ms() - run.info.start_time < SILENT_DAYS * 86_400_000


def is_own(run: Run) -> bool:
    """Tell whether this process is writing a run."""
    return run.info.status == "RUNNING" and run.data.tags.get(WRITER) == _this_process()


def now_ms() -> int:
    """Return the time [ms since 1970]."""
    return time.time_ns() // 1_000_000


def git_commit(root: Path) -> str | None:
    """Return the project's commit; None outside of a git repository, or before the first."""
    try:
        found = subprocess.run(
            ["git", "rev-parse", "HEAD"], cwd=root, capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return found.stdout.strip()


def _this_process() -> str:
    process = psutil.Process()
    return f"{socket.gethostname()} {process.pid} {process.create_time():.2f}"


def _exists(process: str) -> bool:
    """Tell whether a process, given by id and start time, still runs.

    One that has ended keeps its id until its parent takes note, which in containers may be never.
    """
    process_id, _, created = process.partition(" ")
    try:
        found = psutil.Process(int(process_id))
        is_same = f"{found.create_time():.2f}" == created
        return is_same and found.status() != psutil.STATUS_ZOMBIE
    except (psutil.Error, ValueError):
        return False


def _latest(metrics: Iterable[Metric]) -> dict[str, float]:
    ordered = sorted(metrics, key=lambda metric: metric.timestamp)
    return {metric.key: metric.value for metric in ordered}


@contextmanager
def _opened_alone(uri: str) -> Iterator[None]:
    """Keep others from opening a database that is a file meanwhile.

    The first one that opens it makes the tables, and MLflow leaves a broken database behind where
    two do so at once.
    """
    if not uri.startswith("sqlite:///"):
        yield
        return
    path = Path(uri.removeprefix("sqlite:///"))
    _check_sqlite(path)
    with path.with_name(f"{path.name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _check_sqlite(path: Path) -> None:
    """Open a database once; MLflow itself would retry for minutes."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with sqlite3.connect(path) as connection:
            connection.execute("PRAGMA schema_version")
        connection.close()
    except (sqlite3.Error, OSError) as error:
        raise InputError(
            f"{path}: cannot be opened as a database ({error}); "
            "if it is damaged, delete it: `python -m stages.track` makes it anew"
        ) from error


def _is_server(uri: str) -> bool:
    return uri.startswith(("http://", "https://", "databricks"))


def _experiment_id(client: MlflowClient, uri: str, project: Path) -> str:
    # A server decides itself where artifacts go; a database would take the current folder.
    location = None if _is_server(uri) else (project / "mlartifacts").as_uri()
    experiment = client.get_experiment_by_name(EXPERIMENT)
    if experiment is None:
        try:
            return client.create_experiment(EXPERIMENT, location, pages.KIND_TAGS)
        except MlflowException:  # another process made it just now
            experiment = client.get_experiment_by_name(EXPERIMENT)
            if experiment is None:
                raise
    if experiment.lifecycle_stage == "deleted":
        client.restore_experiment(experiment.experiment_id)
    if uri == f"sqlite:///{project}/mlflow.db" and experiment.artifact_location != location:
        raise InputError(
            f"mlflow.db: given artifacts in {experiment.artifact_location}, allowed: {location}; "
            "the project was moved: delete mlflow.db, and `python -m stages.track` makes it anew"
        )
    return str(experiment.experiment_id)


def _explain(error: BaseException) -> str:
    """Say in one line what happened."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, requests.ConnectionError | requests.Timeout):
            return "cannot be reached; start it, or unset MLFLOW_TRACKING_URI to use mlflow.db"
        cause = cause.__cause__ or cause.__context__
    message = _without_password(" ".join(str(error).split()))
    return message if len(message) <= LONGEST_MESSAGE else message[:LONGEST_MESSAGE] + "..."


def _without_password(uri: str) -> str:
    return re.sub(r"//[^/@]*@", "//", uri)
