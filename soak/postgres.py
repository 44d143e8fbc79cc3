"""A PostgreSQL server of one's own: in a temporary folder, on a free port, and gone afterwards.

It is the one that Debian and Ubuntu install (`sudo apt-get install postgresql`). It refuses to run
as root; root starts it as the user `nobody`.
"""

import os
import secrets
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psycopg

HOST = "127.0.0.1"
USER = "robot"
MISSING = "PostgreSQL's server is not installed; on Debian: sudo apt-get install postgresql"


@dataclass
class Postgres:
    """A server that can be stopped, killed and started again.

    Attributes:
        folder: Where it keeps everything.
        port: Of this machine, at which it listens.
        password: Of its only user.
    """

    folder: Path
    port: int
    password: str = field(repr=False)

    def uri(self, database: str) -> str:
        """Return the address of a database, with user and password, as SQLAlchemy writes it."""
        return f"postgresql://{USER}:{self.password}@{HOST}:{self.port}/{database}"

    def create(self, database: str, template: str = "template1") -> str:
        """Create a database, a copy of another one, and return its address."""
        self.query(
            f"SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = '{template}'"
        )
        self.query(f'CREATE DATABASE "{database}" TEMPLATE "{template}"')
        return self.uri(database)

    def query(self, sql: str, database: str = "postgres") -> list[tuple[Any, ...]]:
        """Run SQL, and return the rows of its result."""
        with psycopg.connect(self.uri(database), autocommit=True) as connection:
            cursor = connection.execute(sql.encode())
            return cursor.fetchall() if cursor.description else []

    @contextmanager
    def locked(self, table: str, database: str) -> Iterator[None]:
        """Keep everybody else from a table."""
        with psycopg.connect(self.uri(database)) as connection:
            connection.execute(f'LOCK TABLE "{table}" IN ACCESS EXCLUSIVE MODE'.encode())
            yield

    def start(self) -> None:
        """Start, and wait until it answers."""
        log = str(self.folder / "log")
        self._control("-l", log, "start")

    def stop(self) -> None:
        """Stop as an administrator does: whoever is connected is thrown out."""
        self._control("-m", "fast", "stop")

    def kill(self) -> None:
        """Kill all its processes, as a power cut does."""
        self._control("-m", "immediate", "stop")

    def _control(self, *arguments: str) -> None:
        self._run("pg_ctl", "-w", "-s", "-D", str(self.folder / "data"), *arguments)

    def _run(self, name: str, *arguments: str) -> None:
        program = _program(name)
        if program is None:
            raise RuntimeError(MISSING)
        done = subprocess.run(
            [program, *arguments],
            cwd=self.folder,
            user="nobody" if os.getuid() == 0 else None,
            env={"PATH": os.defpath, "LC_ALL": "C"},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            encoding="utf-8",
        )
        if done.returncode:
            raise RuntimeError(f"{name}: {done.stderr.strip()}")


def is_installed() -> bool:
    """Tell whether there is a PostgreSQL to start."""
    return _program("initdb") is not None


@contextmanager
def running() -> Iterator[Postgres]:
    """Start a server with an empty cluster of databases, and remove both at the end."""
    with tempfile.TemporaryDirectory(prefix="postgres") as name:
        folder = Path(name)
        with socket.create_server((HOST, 0)) as probe:
            port: int = probe.getsockname()[1]
        server = Postgres(folder, port, secrets.token_hex(8))
        secret = folder / "password"
        secret.write_text(server.password, encoding="ascii")
        if os.getuid() == 0:
            for path in (folder, secret):
                shutil.chown(path, "nobody")
        server._run(
            *("initdb", "-D", str(folder / "data"), "-U", USER, "--pwfile", str(secret)),
            *("--auth", "scram-sha-256", "--locale", "C", "--encoding", "UTF8", "--no-sync"),
        )
        settings = {"port": port, "listen_addresses": f"'{HOST}'", "unix_socket_directories": "''"}
        settings |= {"fsync": "off", "max_connections": 100}
        with (folder / "data" / "postgresql.conf").open("a", encoding="ascii") as file:
            file.writelines(f"{key} = {value}\n" for key, value in settings.items())
        server.start()
        try:
            yield server
        finally:
            server.kill()


def _program(name: str) -> str | None:
    """Return where a program of PostgreSQL is: Debian has some where no PATH leads."""
    debian = sorted(Path("/usr/lib/postgresql").glob(f"*/bin/{name}"))
    return str(debian[-1]) if debian else shutil.which(name)
