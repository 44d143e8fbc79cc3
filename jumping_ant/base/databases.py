"""Databases that several machines share: how long to wait for one, and who goes first.

PostgreSQL's client library reads its waiting times from the environment, so that they hold for the
connections of MLflow and Optuna, too.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import sqlalchemy
from sqlalchemy import text
from sqlalchemy.pool import NullPool

POSTGRESQL = "postgresql"
KINDS = (POSTGRESQL, "mysql", "mssql")  # with a server


def is_shared(uri: str) -> bool:
    """Tell whether a URI is that of a database with a server, be it well-formed or not."""
    return _kind(uri) in KINDS


def installation(error: ModuleNotFoundError) -> str:
    """Return the command that installs the driver that is missing."""
    return "make shared" if error.name == "psycopg" else f"pip install {error.name}"


def limit_waiting(seconds: int) -> None:
    """Wait for a connection, and for what others have locked, only so long; PostgreSQL never would.

    What the user has set counts more.
    """
    os.environ.setdefault("PGCONNECT_TIMEOUT", str(seconds))
    os.environ.setdefault("PGOPTIONS", f"-c lock_timeout={seconds}s")


@contextmanager
def held(uri: str, name: str, say: Callable[[], None] = lambda: None) -> Iterator[None]:
    """Connect to a database, and hold a lock that its clients know by name, as long as it takes.

    The lock ends with this process, however that ends. Only PostgreSQL has such locks; other
    databases are just asked whether they answer.

    Args:
        uri: The database's.
        name: The lock's.
        say: Called if another client holds it and is waited for.

    Raises:
        SQLAlchemyError: The database cannot be reached, or does not let this client in.
    """
    engine = sqlalchemy.create_engine(uri, poolclass=NullPool)
    with engine.connect() as connection:
        if _kind(uri) == POSTGRESQL:
            key = {"key": name}
            connection.execute(text("SET lock_timeout = 0"))
            if not connection.scalar(text("SELECT pg_try_advisory_lock(hashtext(:key))"), key):
                say()
                connection.execute(text("SELECT pg_advisory_lock(hashtext(:key))"), key)
        connection.commit()  # the lock stays; an open transaction would keep old rows alive
        yield


def _kind(uri: str) -> str:
    return uri.partition("://")[0].partition("+")[0]
