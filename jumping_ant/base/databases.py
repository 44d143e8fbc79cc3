"""Databases that several machines share: how long to wait, who goes first, what to show of them.

PostgreSQL's client reads its waiting times from the environment, also within MLflow and Optuna.
"""

import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import sqlalchemy
from sqlalchemy import text
from sqlalchemy.pool import NullPool

KINDS = ("postgresql", "mysql", "mssql")  # with a server


def is_shared(uri: str) -> bool:
    """Tell whether a URI is that of a database with a server, be it well-formed or not."""
    return _kind(uri) in KINDS


def without_password(text: str) -> str:
    """Return a text whose URIs have neither user and password nor a query.

    SQLAlchemy's `hide_password` shows queries, and what follows an unquoted `@` in a password.
    """
    text = re.sub(r"(?<=://)\S*\?\S*@\S*", "...", text)  # whose "?" it is cannot be told
    return re.sub(r"(?<=://)(?:\S*@)?([^\s?]*)\S*", r"\1", text)


def without_secret(message: str, uri: str) -> str:
    """Return what is said of a URI without its password, parts of it, and those of other URIs."""
    secret = uri.partition("://")[2].rpartition("@")[0].partition(":")[2]
    for part in filter(None, [secret, *re.split("[/:@?]", secret)]):  # may be taken for a port
        message = message.replace(part, "...")
    return without_password(message)


def installation(error: ModuleNotFoundError) -> str:
    """Return the command that installs the driver that is missing."""
    return "make shared" if error.name == "psycopg" else f"pip install {error.name}"


def limit_waiting(seconds: int) -> None:
    """Wait for connections and locks only so long, or as long as the user has set."""
    os.environ.setdefault("PGCONNECT_TIMEOUT", str(seconds))
    os.environ.setdefault("PGOPTIONS", f"-c lock_timeout={seconds}s")


@contextmanager
def held(uri: str, name: str, say: Callable[[], None] = lambda: None) -> Iterator[None]:
    """Connect to a database, and hold a lock that its clients know by name; `say` if it is taken.

    The lock ends with this process, however that ends. Only PostgreSQL has such locks; other
    databases are just asked whether they answer. A SQLAlchemyError says that one does not.
    """
    engine = sqlalchemy.create_engine(uri, poolclass=NullPool)
    with engine.connect() as connection:
        if _kind(uri) == "postgresql":
            key = {"key": name}
            connection.execute(text("SET lock_timeout = 0"))
            if not connection.scalar(text("SELECT pg_try_advisory_lock(hashtext(:key))"), key):
                say()
                connection.execute(text("SELECT pg_advisory_lock(hashtext(:key))"), key)
        connection.commit()  # the lock stays; an open transaction would keep old rows alive
        yield


def _kind(uri: str) -> str:
    return uri.partition("://")[0].partition("+")[0]
