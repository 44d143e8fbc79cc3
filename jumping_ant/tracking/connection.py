"""The connection to MLflow: where the store is, how it is opened, how its failures are reported."""

import fcntl
import logging
import os
import re
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from jumping_ant.base import telemetry

telemetry.switch_off()  # before MLflow is imported

import mlflow  # noqa: E402
import requests  # noqa: E402
from mlflow import MlflowClient  # noqa: E402
from mlflow.exceptions import MlflowException  # noqa: E402
from mlflow.store.tracking.sqlalchemy_store import SqlAlchemyStore  # noqa: E402
from sqlalchemy.exc import SQLAlchemyError  # noqa: E402

from jumping_ant.base.errors import InputError  # noqa: E402
from jumping_ant.base.files import PROJECT_ROOT  # noqa: E402
from jumping_ant.base.paths import home  # noqa: E402
from jumping_ant.tracking import pages  # noqa: E402

# Silence MLflow, too; set these variables to re-enable its output.
os.environ.setdefault("MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT", "true")
os.environ.setdefault("MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR", "false")
if "MLFLOW_LOGGING_LEVEL" not in os.environ:
    logging.getLogger("mlflow").setLevel(logging.ERROR)
    logging.getLogger("urllib3").setLevel(logging.ERROR)  # logs every retry

EXPERIMENT = "jumping-ant"
SIGNS_OF_CONFLICT = ("UNIQUE constraint failed", "duplicate key", "database is locked")
LONGEST_MESSAGE = 300
SECONDS_FOR_ANSWER = 5


@dataclass(frozen=True)
class Connection:
    """An open MLflow store.

    Attributes:
        client: MLflow's client.
        experiment_id: The project's experiment.
        uri: The tracking URI.
    """

    client: MlflowClient
    experiment_id: str
    uri: str

    @property
    def name(self) -> str:
        """The tracking URI, without a password."""
        return _without_password(self.uri)

    @property
    def is_server(self) -> bool:
        """Whether it is a server, which shows pages and decides where artifacts go."""
        return is_server(self.uri)


class ConflictError(InputError):
    """Two processes wrote the same thing at once, and the database accepted the other's write."""


@contextmanager
def failures_as_input_errors(uri: str) -> Iterator[None]:
    """Convert errors of MLflow and its database into one-line input errors.

    Raises:
        ConflictError: Another process wrote the same thing at the same time.
        InputError: MLflow failed.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise InputError(
            f"MLflow at {_without_password(uri)}: its driver is not installed; run: pip install "
            f"{error.name}"
        ) from error
    except (MlflowException, SQLAlchemyError, OSError) as error:
        is_conflict = any(sign in str(error) for sign in SIGNS_OF_CONFLICT)
        kind = ConflictError if is_conflict else InputError
        raise kind(f"MLflow at {_without_password(uri)}: {_explain(error, uri)}") from error


def connect(root: Path, timeout_seconds: int, max_retries: int) -> Connection:
    """Open the store and the project's experiment, which is created if needed.

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
    # It would log a traceback of errors that are reported in one line.
    logging.getLogger("mlflow.store.db.utils").setLevel(logging.CRITICAL)
    with failures_as_input_errors(uri), _opened_alone(uri, home(root)):
        _await_answer(uri)
        is_given = "MLFLOW_TRACKING_URI" in os.environ
        mlflow.set_tracking_uri(uri)  # the model registry needs it
        if not is_given:
            os.environ.pop("MLFLOW_TRACKING_URI", None)  # set, too, but only for this root
        client = MlflowClient(uri)
        experiment_id = _experiment_id(client, uri, home(root))
    return Connection(client, experiment_id, uri)


def tracking_uri(root: Path = PROJECT_ROOT) -> str:
    """Return `MLFLOW_TRACKING_URI`, or the database in the project folder."""
    return os.environ.get("MLFLOW_TRACKING_URI") or _own_uri(home(root))


def _own_uri(project: Path) -> str:
    """Return the URI of the database in a project folder, whatever the folder is called."""
    path = project / "mlflow.db"
    # In such a URI a query begins with the first question mark, and nothing can be quoted.
    return f"sqlite:///{os.path.relpath(path) if '?' in str(path) else path}"


@contextmanager
def _opened_alone(uri: str, project: Path) -> Iterator[None]:
    """Keep other processes from opening a database file meanwhile.

    The first one that opens it creates the tables, and MLflow leaves a broken database behind if
    two do so at once.
    """
    path = _database(uri)
    if path is None:
        yield
        return
    if not path.name:
        raise InputError(
            f"MLFLOW_TRACKING_URI: given {uri!r}, allowed: sqlite:///FILE, or a server's address"
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.with_name(f"{path.name}.lock").open("w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if _is_empty(path):
            # By itself MLflow would put the current folder's name into SQL, with its quotes.
            SqlAlchemyStore(uri, (project / "mlartifacts").as_uri())
        yield


@contextmanager
def mirrored_alone(uri: str, say: Callable[[str], None]) -> Iterator[None]:
    """Keep other processes from mirroring files to a database file meanwhile.

    Two would replace each other's model files. With a server, each uploads its own.

    Args:
        uri: The tracking URI.
        say: Receives a line if another process must be waited for.
    """
    path = _database(uri)
    if path is None:
        yield
        return
    with path.with_name(f"{path.name}.mirror.lock").open("w", encoding="utf-8") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say("another process is bringing MLflow up to date; waiting for it")
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _database(uri: str) -> Path | None:
    """Return the file of a database; None if the store is something else."""
    return Path(uri.removeprefix("sqlite:///")) if uri.startswith("sqlite:///") else None


def _is_empty(path: Path) -> bool:
    """Open a database once, and tell if it has no tables; MLflow itself would retry for minutes."""
    try:
        with sqlite3.connect(path) as connection:
            (version,) = connection.execute("PRAGMA schema_version").fetchone()
        connection.close()
        return bool(version == 0)
    except (sqlite3.Error, OSError) as error:
        if "locked" in str(error):
            raise ConflictError(f"{path}: in use by another program; try again later") from error
        raise InputError(
            f"{path}: cannot be opened as a database ({error}); "
            "if it is damaged, delete it: `python -m stages.track` recreates it"
        ) from error


def _await_answer(uri: str) -> None:
    """Ask a server for a sign of life, of any kind; MLflow would wait for minutes.

    Raises:
        OSError: There is none in time.
    """
    if uri.startswith("http"):
        requests.get(f"{uri.rstrip('/')}/health", timeout=SECONDS_FOR_ANSWER)


def is_server(uri: str) -> bool:
    """Tell whether a tracking URI names a server."""
    return uri.startswith(("http://", "https://", "databricks"))


def _experiment_id(client: MlflowClient, uri: str, project: Path) -> str:
    # A server decides where artifacts go; a database would default to the current folder.
    location = None if is_server(uri) else (project / "mlartifacts").as_uri()
    experiment = client.get_experiment_by_name(EXPERIMENT)
    if experiment is None:
        try:
            return client.create_experiment(EXPERIMENT, location, pages.KIND_TAGS)
        except MlflowException:  # another process created it just now
            experiment = client.get_experiment_by_name(EXPERIMENT)
            if experiment is None:
                raise
    if experiment.lifecycle_stage == "deleted":
        client.restore_experiment(experiment.experiment_id)
    if uri == _own_uri(project) and experiment.artifact_location != location:
        raise InputError(
            f"mlflow.db: given artifacts in {experiment.artifact_location}, allowed: {location}; "
            "the project was moved: delete mlflow.db, and `python -m stages.track` recreates it"
        )
    return str(experiment.experiment_id)


def _explain(error: BaseException, uri: str) -> str:
    """Return what happened, in one line."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, requests.ConnectionError | requests.Timeout):
            return "cannot be reached; start it, or unset MLFLOW_TRACKING_URI to use mlflow.db"
        cause = cause.__cause__ or cause.__context__
    message = _without_password_of(uri, " ".join(str(error).split()))
    return message if len(message) <= LONGEST_MESSAGE else message[:LONGEST_MESSAGE] + "..."


def _without_password(text: str) -> str:
    """Return a text whose URIs have neither user and password nor a query."""
    return re.sub(r"(?<=://)\S+", _place, text)


def _place(match: re.Match[str]) -> str:
    """Return the part of a URI's rest that is no secret; a password may hold any character."""
    secret, _, place = match[0].rpartition("@")
    return "..." if "?" in secret else place.partition("?")[0]


def _without_password_of(uri: str, text: str) -> str:
    """Return a text about a URI without its password, or a part that was taken for a port."""
    secret = uri.partition("://")[2].rpartition("@")[0].partition(":")[2]
    for part in [secret, *re.split("[/:@?]", secret)]:
        if part:
            text = text.replace(part, "...")
    return _without_password(text)
