"""`make ui`: MLflow's pages are for who has the address that it printed."""

import os
import re
import resource
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import mlflow
import psutil
import pytest
import requests
from browser import OpenPage
from mlflow.exceptions import MlflowException
from playwright.sync_api import expect
from tracked_project import AGGREGATES, copy_tracked

from jumping_ant.base.errors import InputError
from jumping_ant.tracking import ui

RUN = """
import pathlib, sys
from jumping_ant.tracking import ui
ui.PROJECT_ROOT = pathlib.Path(sys.argv.pop(1))
ui.main()
"""
JSON = {"Content-Type": "application/json"}
UPGRADE = {
    **{"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13"},
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
}
PRINTED = re.compile(r"(http://127\.0\.0\.1:(\d+)/)\?token=([0-9a-f]{32})#/experiments/1/.+")


@dataclass(frozen=True)
class Served:
    """A running `make ui`, the address that it printed, and its parts."""

    process: subprocess.Popen[str]
    project: Path  # whose database the tests here may add to
    printed: str
    address: str
    port: str
    token: str

    @property
    def bearer(self) -> dict[str, str]:
        return {"Authorization": f"Bearer {self.token}"}

    @property
    def cookie(self) -> dict[str, str]:
        return {"Cookie": f"jumping-ant-{self.port}={self.token}"}


def as_a_login_does() -> None:
    """Shells have what they run in the background ignore Ctrl-C, these tests perhaps."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (1024, most))


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory, tracked_template: Path) -> Iterator[Served]:
    root = tmp_path_factory.mktemp("served") / "a project"
    copy_tracked(tracked_template, root)
    process = subprocess.Popen(
        [sys.executable, "-c", RUN, str(root), "--port", "0"],
        cwd=root,
        env={name: value for name, value in os.environ.items() if not name.startswith("MLFLOW_")},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        preexec_fn=as_a_login_does,
    )
    assert process.stdout is not None
    lines = iter(process.stdout.readline, "")
    line = next((line for line in lines if line.startswith("Look at ")), "")
    try:
        printed = PRINTED.search(line)
        assert printed, process.communicate()[1]
        yield Served(process, root, printed[0], *printed.groups())
    finally:
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=30)
    assert process.returncode == 0 and "Traceback" not in errors, errors


def status(address: str, headers: dict[str, str], method: str = "GET", content: str = "") -> int:
    """Ask the server, and return the status of its answer."""
    return requests.request(method, address, headers=headers, data=content).status_code


def test_the_address_opens_the_pages(served: Served) -> None:
    entrance = requests.get(served.printed)
    cookie = entrance.headers["Set-Cookie"]
    assert "location.replace" in entrance.text and cookie.startswith(served.cookie["Cookie"] + ";")
    assert "HttpOnly" in cookie and "samesite=lax" in cookie.lower()
    assert status(served.address, served.cookie) == status(served.address, served.bearer) == 200


@pytest.mark.parametrize(
    ("place", "headers"),
    [
        *((place, {}) for place in ("", "?token=%C3%A9%00", "?Token={token}", "health")),
        ("", {"Cookie": "jumping-ant-{port}="}),
        ("", {"Cookie": "jumping-ant-1{port}={token}"}),
        ("", {"Cookie": "jumping-ant-{port}={token}\xe9"}),
        ("", {"Authorization": "Basic {token}"}),
        ("", {"Authorization": "Bearer "}),
        ("", UPGRADE),
    ],
)
def test_nothing_else_does(place: str, headers: dict[str, str], served: Served) -> None:
    known = {"port": served.port, "token": served.token}
    filled = {name: value.format(**known) for name, value in headers.items()}
    for method in ("GET", "POST", "OPTIONS", "STRANGE"):
        assert status(served.address + place.format(**known), filled, method) == 403


def test_pages_of_other_ports_change_nothing(served: Served) -> None:
    """They are of the same site, so the browser sends this site's cookies along."""
    change = served.address + "api/2.0/mlflow/registered-models/create"
    for origin in ("http://127.0.0.1:9", "http://localhost:9", "null", "http://evil.example", ""):
        headers = {**served.cookie, **JSON, "Origin": origin}
        assert status(change, headers, "POST", '{"name": "evil"}') == 403, origin
    headers = {**served.cookie, **JSON, "Origin": served.address.rstrip("/")}
    assert status(change, headers, "POST", '{"name": "evil"}') == 200
    assert status(served.address, {**served.bearer, "Host": "evil.example"}) == 403


def test_who_asks_nothing_keeps_nobody_out(served: Served) -> None:
    """As many connections as a process may usually open files; they are closed after a while."""
    usual, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    with ExitStack() as stack:
        stack.callback(resource.setrlimit, resource.RLIMIT_NOFILE, (usual, most))
        place = ("127.0.0.1", int(served.port))
        idle = [stack.enter_context(socket.create_connection(place)) for _ in range(1200)]
        began = time.monotonic()
        assert status(served.address, served.cookie) == 200
        assert time.monotonic() - began < 10
        idle[-1].settimeout(30)
        assert idle[-1].recv(1) == b""


def test_clients_of_mlflow_bring_the_token(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who has it can upload nothing."""
    client = mlflow.MlflowClient(served.address)
    with pytest.raises(MlflowException, match="403.*MLFLOW_TRACKING_TOKEN"):
        client.search_experiments()
    monkeypatch.setenv("MLFLOW_TRACKING_TOKEN", served.token)
    assert "jumping-ant" in [experiment.name for experiment in client.search_experiments()]
    files = sorted((served.project / "mlartifacts").rglob("*"))
    upload = f"{served.address}api/2.0/mlflow-artifacts/artifacts/models/evil.py"
    assert status(upload, served.bearer, "PUT", "print('hello')") >= 400
    assert sorted((served.project / "mlartifacts").rglob("*")) == files


def test_the_token_is_nowhere_that_others_can_look(served: Served) -> None:
    server = psutil.Process(served.process.pid)
    for process in (server, *server.children(recursive=True)):
        assert served.token not in " ".join(process.cmdline())
    for path in served.project.rglob("*"):
        assert not path.is_file() or served.token.encode() not in path.read_bytes()


def test_a_port_that_cannot_be_had_ends_in_one_line(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        for number in (port, 65536):
            with pytest.raises(InputError, match=rf"^--port: given {number} \(.+\), allowed: .+$"):
                ui.run(tmp_path, number)


def test_the_printed_address_and_links_in_the_report_show_the_runs(
    served: Served, tmp_path: Path, open_page: OpenPage
) -> None:
    """Links work once the printed address has been opened in this browser; the report is a file."""
    visit = open_page(served.printed)
    visit.page.wait_for_url(lambda address: served.token not in address)
    shown = visit.page.get_by_role("link", name=AGGREGATES[0])
    expect(shown).to_be_visible()
    assert "#/experiments/1/runs" in visit.page.url
    assert visit.page.evaluate("document.cookie") == "", "out of reach of what pages run"
    report = tmp_path / "report.html"
    report.write_text(f'<a href="{visit.page.url}">the runs</a>', encoding="utf-8")
    visit.page.goto(report.as_uri())
    visit.page.click("a")
    expect(shown).to_be_visible()
