"""MLflow's records in a PostgreSQL of Debian's, on a free port; it refuses to run as root."""

import os
import shutil
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from tracked_project import tracked

from jumping_ant.base.errors import InputError

PROGRAMS = sorted(Path("/usr/lib/postgresql").glob("*/bin"))


@pytest.fixture
def postgres(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a database with nothing in it."""
    if not PROGRAMS:
        pytest.skip("no PostgreSQL here: sudo apt-get install postgresql")
    pytest.importorskip("psycopg", reason="no driver of PostgreSQL: make shared")
    folder = Path("/tmp") / tmp_path_factory.mktemp("postgres").name  # others may enter
    folder.mkdir()
    user = "nobody" if os.getuid() == 0 else None
    if user:
        shutil.chown(folder, user)

    def run(name: str, *arguments: str) -> None:
        command = [PROGRAMS[-1] / name, "-D", folder / "data", *arguments]
        subprocess.run(command, cwd=folder, user=user, check=True, stdout=subprocess.DEVNULL)

    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    run("initdb", "-U", "robot", "--auth", "trust", "--no-sync")
    run("pg_ctl", "-w", "-o", f"-p {port} -h 127.0.0.1 -k ''", "-l", str(folder / "log"), "start")
    try:
        yield f"postgresql://robot:secret@127.0.0.1:{port}/postgres"
    finally:
        run("pg_ctl", "-m", "immediate", "stop")
        shutil.rmtree(folder)


def test_records_are_kept_in_postgresql(
    postgres: str, untracked_project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", postgres)
    assert tracked(untracked_project)[-1].endswith("/postgres: 4 created")
    assert tracked(untracked_project)[-1].endswith("/postgres: 4 unchanged")
    monkeypatch.setenv("MLFLOW_TRACKING_URI", postgres.replace("robot:", "nobody:"))
    with pytest.raises(InputError, match='role "nobody" does not exist') as caught:
        tracked(untracked_project)
    assert "secret" not in str(caught.value) and "\n" not in str(caught.value)
