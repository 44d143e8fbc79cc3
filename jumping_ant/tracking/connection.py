"""The connection to MLflow: where the store is, how it is opened, how its failures are reported."""

import logging
import os
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, contextmanager
from pathlib import Path

import mlflow
import requests
from filelock import Timeout
from mlflow import MlflowClient
from mlflow.exceptions import MlflowException
from mlflow.store.tracking.sqlalchemy_store import SqlAlchemyStore
from sqlalchemy import make_url
from sqlalchemy.exc import SQLAlchemyError

from jumping_ant.base import databases, locks
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.base.paths import home
from jumping_ant.tracking.pages import EXPERIMENT_KIND

LONGEST_MESSAGE = 300
SECONDS_FOR_ANSWER = 5


@contextmanager
def failures_as_input_errors(uri: str) -> Iterator[None]:
    """Convert errors of MLflow and its database into one-line input errors."""
    place = f"MLflow at {databases.without_password(uri)}"
    try:
        yield
    except ModuleNotFoundError as error:
        command = databases.installation(error)
        raise InputError(f"{place}: its driver is not installed; run: {command}") from error
    except (MlflowException, SQLAlchemyError, sqlite3.Error, OSError) as error:
        raise InputError(f"{place}: {_explain(error, uri)}") from error


def connect(
    root: Path, experiment: str, timeout_seconds: int, max_retries: int
) -> tuple[MlflowClient, str, str]:
    """Return a client, the id of an experiment, created if needed, and the tracking URI."""
    uri = tracking_uri(root)
    _silence()
    os.environ.setdefault("MLFLOW_HTTP_REQUEST_TIMEOUT", str(timeout_seconds))
    os.environ.setdefault("MLFLOW_HTTP_REQUEST_MAX_RETRIES", str(max_retries))
    databases.limit_waiting(timeout_seconds)
    with failures_as_input_errors(uri), _opened_alone(uri, home(root)):
        if uri.startswith("http"):  # MLflow would wait for minutes for a sign of life
            requests.get(f"{uri.rstrip('/')}/health", timeout=SECONDS_FOR_ANSWER)
        is_set = "MLFLOW_TRACKING_URI" in os.environ
        mlflow.set_tracking_uri(uri)  # the model registry needs it
        if not is_set:
            os.environ.pop("MLFLOW_TRACKING_URI", None)  # set, too, but only for this root
        client = MlflowClient(uri)
        experiment_id = _experiment_id(client, uri, home(root), experiment)
    return client, experiment_id, uri


def tracking_uri(root: Path = PROJECT_ROOT) -> str:
    """Return `MLFLOW_TRACKING_URI`, or the database in the project folder."""
    return os.environ.get("MLFLOW_TRACKING_URI") or _local_uri(home(root))


def _local_uri(project: Path) -> str:
    path = project / "mlflow.db"
    # In such a URI a query begins with the first question mark, and nothing can be quoted.
    return f"sqlite:///{os.path.relpath(path) if '?' in str(path) else path}"


def _silence() -> None:
    """Keep MLflow from printing; its variables re-enable its output."""
    os.environ.setdefault("MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT", "true")
    os.environ.setdefault("MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR", "false")
    logging.getLogger("mlflow.store.db.utils").setLevel(logging.CRITICAL)  # prints tracebacks
    if "MLFLOW_LOGGING_LEVEL" not in os.environ:
        for name in ("mlflow", "urllib3"):  # the second logs every retry
            logging.getLogger(name).setLevel(logging.ERROR)


@contextmanager
def _opened_alone(uri: str, project: Path) -> Iterator[None]:
    """Keep others from opening a database meanwhile, as MLflow cannot make its tables twice."""
    path = _database(uri)
    if path is not None and not path.name:
        raise InputError(
            f"MLFLOW_TRACKING_URI: given {uri!r}, allowed: sqlite:///FILE, or a server's address"
        )
    with _held(uri, "jumping-ant opens it", "lock", lambda: None):
        if path is not None and _is_empty(path):
            SqlAlchemyStore(uri, artifacts_uri(project))  # the client would quote no folder name
        yield


def mirrored_alone(uri: str, say: Callable[[str], None]) -> AbstractContextManager[None]:
    """Keep other processes from mirroring to a database: they would replace each other's runs."""
    line = "another process is bringing MLflow up to date; waiting for it"
    return _held(uri, "jumping-ant mirrors to it", "mirror.lock", lambda: say(line))


@contextmanager
def _held(uri: str, name: str, suffix: str, wait: Callable[[], None]) -> Iterator[None]:
    """Hold a lock, beside a database's file or by name in its server; MLflow's server has none."""
    path = _database(uri)
    if databases.is_shared(uri):
        with databases.held(uri, name, wait):
            yield
    elif path is None:
        yield
    else:
        lock = locks.lock(path.with_name(f"{path.name}.{suffix}"), path.parent)
        try:
            lock.acquire(blocking=False)
        except Timeout:
            wait()
            lock.acquire()
        with lock:
            yield


def _database(uri: str) -> Path | None:
    """Return the file of a database; None if the store is something else."""
    return Path(make_url(uri).database or "") if uri.startswith("sqlite") else None


def _is_empty(path: Path) -> bool:
    """Tell if a database has no tables; MLflow itself would retry for minutes to open it."""
    with closing(sqlite3.connect(path)) as connection:
        return bool(connection.execute("PRAGMA schema_version").fetchone() == (0,))


def is_server(uri: str) -> bool:
    """Tell whether a tracking URI names a server."""
    return uri.startswith(("http://", "https://", "databricks"))


def artifacts_uri(project: Path) -> str:
    """Return where the database in a project folder keeps artifacts."""
    return (project / "mlartifacts").as_uri()


def _experiment_id(client: MlflowClient, uri: str, project: Path, name: str) -> str:
    # A server decides where artifacts go; a database would default to the current folder.
    location = None if is_server(uri) else artifacts_uri(project)
    experiment = client.get_experiment_by_name(name)
    if experiment is None:
        return client.create_experiment(name, location, EXPERIMENT_KIND)
    if experiment.lifecycle_stage == "deleted":
        client.restore_experiment(experiment.experiment_id)
    if uri == _local_uri(project) and experiment.artifact_location != location:
        raise InputError(
            f"mlflow.db: given artifacts in {experiment.artifact_location}, allowed: {location}; "
            "the project was moved: delete mlflow.db, and `python -m stages.track` recreates it"
        )
    return str(experiment.experiment_id)


def _explain(error: BaseException, uri: str) -> str:
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, requests.exceptions.RetryError):
            return "answers with failures only; see whether its database runs, then try again"
        if isinstance(cause, requests.ConnectionError | requests.Timeout):
            is_up = isinstance(cause, requests.ReadTimeout)
            busy = " in time; if it is busy, try again later" if is_up else "; start it"
            return f"cannot be reached{busy}, or unset MLFLOW_TRACKING_URI to use mlflow.db"
        cause = cause.__cause__ or cause.__context__
    message = " ".join(str(error).partition("(Background on this error")[0].split())
    if "lock timeout" in message or "database is locked" in message:
        return "in use by another program; try again later"
    if isinstance(error, sqlite3.Error):
        return f"{message}; if it is damaged, delete it: `python -m stages.track` recreates it"
    return databases.without_secret(message, uri)[:LONGEST_MESSAGE]
