"""`make ui`: MLflow's pages are this user's alone, and what they show is what was trained."""

import os
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from tracked_project import answers, free_port, tracked, wait_for

from jumping_ant.tracking import own_pages, ui

NOBODY = 65534
SERVE = "import sys, pathlib; from jumping_ant.tracking import ui\n"
SERVE += "ui.serve(sys.argv[1], pathlib.Path(sys.argv[2]), int(sys.argv[3]))"


@pytest.fixture
def address(project: Path) -> Iterator[str]:
    port = free_port()
    uri = f"sqlite:///{project}/mlflow.db"
    process = subprocess.Popen(
        [sys.executable, "-c", SERVE, uri, str(project), str(port)],
        cwd=project,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        wait_for(lambda: answers(f"http://127.0.0.1:{port}"))
        yield f"http://127.0.0.1:{port}"
    finally:
        process.terminate()
        process.wait(30)


def status(address: str, method: str = "GET", content: bytes | None = None) -> int:
    request = urllib.request.Request(address, content, method=method)
    try:
        with urllib.request.urlopen(request, timeout=30) as response:
            return int(response.status)
    except urllib.error.HTTPError as error:
        return error.code


def status_for_nobody(address: str, method: str = "GET") -> int:
    """Return what another user of the machine is answered."""
    reading, writing = os.pipe()
    child = os.fork()  # a new program might lie where that user may not read it
    if child == 0:
        with suppress(BaseException):
            os.setgroups([])
            os.setgid(NOBODY)
            os.setuid(NOBODY)
            os.write(writing, str(status(address, method)).encode())
        os._exit(0)
    os.close(writing)
    with open(reading, encoding="utf-8") as pipe:
        os.waitpid(child, 0)
        return int(pipe.read())


def test_nobody_else_is_answered_and_nothing_can_be_uploaded(address: str, project: Path) -> None:
    files = sorted((project / "mlartifacts").rglob("*"))
    upload = f"{address}/api/2.0/mlflow-artifacts/artifacts/models/evil.py"
    assert status(f"{address}/") == 200
    assert status(upload, "PUT", b"print('hello')") >= 400
    if os.getuid() == 0:  # may act as another user
        assert status_for_nobody(f"{address}/") == 403
        run = f"{address}/ajax-api/2.0/mlflow/upload-artifact?run_uuid=a&path=b"
        assert status_for_nobody(run, "POST") == 403
        assert status_for_nobody(upload, "PUT") == 403
    assert sorted((project / "mlartifacts").rglob("*")) == files


def test_the_user_of_a_connection_is_known_while_it_lasts() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        place = server.getsockname()
        with socket.create_connection(place) as client:
            own_end, client_place = server.accept()[0], client.getsockname()
            with own_end:
                assert own_pages.user_of(client_place, place) == os.getuid()
                assert own_pages.user_of(place, client_place) == os.getuid()
                client.close()
                assert own_pages.user_of(client_place, place) is None, "nobody's, or root's"


def test_a_password_is_in_no_argument(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Other users see the arguments of every process."""
    commands: list[list[str]] = []
    monkeypatch.setenv("MLFLOW_BACKEND_STORE_URI", "")
    monkeypatch.setenv("MLFLOW_SERVER_ENABLE_JOB_EXECUTION", "")
    monkeypatch.setattr(os, "execv", lambda _, command: commands.append(command))
    ui.serve("postgresql://me:secret@host/db", tmp_path, 5000)
    assert "secret" not in " ".join(commands[0])
    assert os.environ["MLFLOW_BACKEND_STORE_URI"] == "postgresql://me:secret@host/db"


@pytest.mark.parametrize("how", ["changed", "added", "missing"])
def test_a_model_whose_files_were_changed_is_replaced(untracked_project: Path, how: str) -> None:
    project = untracked_project
    tracked(project)
    assert tracked(project)[-1].endswith("4 unchanged")
    path = next((project / "mlartifacts" / "models").rglob("serving.py"))
    expected = path.read_text(encoding="utf-8")
    if how == "changed":
        path.write_text(expected + "\nprint('hello')\n", encoding="utf-8")
    elif how == "added":
        (path.parent / "numpy.py").write_text("print('hello')\n", encoding="utf-8")
    else:
        path.unlink()
    lines = tracked(project)
    assert lines[-1].endswith("1 repaired, 3 unchanged")
    assert any("models 1" in line for line in lines)
    assert path.read_text(encoding="utf-8") == expected and not (path.parent / "numpy.py").exists()
    assert tracked(project)[-1].endswith("4 unchanged")
