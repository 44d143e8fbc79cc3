"""`make ui`: MLflow's pages are for who has the address that it printed."""

import re
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import mlflow
import psutil
import pytest
from browser import OpenPage
from mlflow.exceptions import MlflowException
from playwright.sync_api import expect
from tracked_project import AGGREGATES, copy_tracked, unset_variables

from jumping_ant.base.errors import InputError
from jumping_ant.tracking import ui

RUN = """
import pathlib, sys
from jumping_ant.tracking import ui
ui.PROJECT_ROOT = pathlib.Path(sys.argv.pop(1))
ui.main()
"""
CREATE_MODEL = "api/2.0/mlflow/registered-models/create"
MODEL = b'{"name": "evil"}'
JSON = {"Content-Type": "application/json"}
UPGRADE = {
    **{"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13"},
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
}


@dataclass(frozen=True)
class Served:
    """A running `make ui`, and the address that it printed."""

    printed: str
    process: subprocess.Popen[str]
    project: Path  # whose database the tests here may add to

    @property
    def address(self) -> str:
        return self.printed.partition("?")[0]

    @property
    def port(self) -> int:
        return int(self.address.split(":")[2].rstrip("/"))

    @property
    def token(self) -> str:
        return self.printed.partition("token=")[2].partition("#")[0]

    @property
    def bearer(self) -> dict[str, str]:
        return {"Authorization": f"Bearer {self.token}"}

    @property
    def cookie(self) -> dict[str, str]:
        return {"Cookie": f"jumping-ant-{self.port}={self.token}"}


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory, tracked_template: Path) -> Iterator[Served]:
    root = tmp_path_factory.mktemp("served") / "a project"
    copy_tracked(tracked_template, root)
    with pytest.MonkeyPatch.context() as monkeypatch:
        unset_variables(monkeypatch)
        process = subprocess.Popen(
            [sys.executable, "-c", RUN, str(root), "--port", "0"],
            cwd=root,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            encoding="utf-8",
            # Shells have what they run in the background ignore Ctrl-C, these tests perhaps.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
    assert process.stdout is not None
    lines = iter(process.stdout.readline, "")
    printed = next((line for line in lines if line.startswith("Look at ")), "")
    try:
        assert printed, process.communicate()[1]
        yield Served(printed.split()[2], process, root)
    finally:
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=30)
    assert (process.returncode, errors) == (0, ""), "Ctrl-C ends it without a word"


def status(
    address: str,
    headers: Mapping[str, str] | None = None,
    method: str = "GET",
    content: bytes | None = None,
) -> int:
    """Ask the server, and return the status of its answer."""
    request = urllib.request.Request(address, content, headers or {}, method=method)
    try:
        with urllib.request.urlopen(request, timeout=30) as response:
            return int(response.status)
    except urllib.error.HTTPError as error:
        return error.code


def test_the_address_opens_the_pages(served: Served) -> None:
    pattern = r"http://127\.0\.0\.1:\d+/\?token=[0-9a-f]{32}#/experiments/1/.+"
    assert re.fullmatch(pattern, served.printed)
    with urllib.request.urlopen(served.printed.partition("#")[0], timeout=30) as entrance:
        assert b"location.replace" in entrance.read()
        cookie = entrance.headers["Set-Cookie"]
    assert cookie.startswith(served.cookie["Cookie"] + ";")
    assert "HttpOnly" in cookie and "samesite=lax" in cookie.lower()
    assert status(served.address, served.cookie) == status(served.address, served.bearer) == 200
    assert status(served.address, UPGRADE | served.cookie) == 200, "a page, as without the upgrade"


@pytest.mark.parametrize(
    ("method", "place", "headers"),
    [
        ("GET", "", {"Cookie": "jumping-ant-{port}="}),
        ("GET", "", {"Cookie": "jumping-ant-1{port}={token}"}),
        ("GET", "", {"Cookie": "jumping-ant-{port}={token}\xe9"}),
        ("GET", "", {"Authorization": "Basic {token}"}),
        ("GET", "", {"Authorization": "Bearer "}),
        ("GET", "", UPGRADE),
        *(("GET", place, {}) for place in ("?token=%C3%A9%00", "?Token={token}", "health")),
        ("GET", "%2e%2e/", {}),
        *((method, "", {}) for method in ("GET", "HEAD", "OPTIONS", "POST", "STRANGE")),
    ],
)
def test_nothing_else_does(
    method: str, place: str, headers: dict[str, str], served: Served
) -> None:
    known = {"port": served.port, "token": served.token}
    filled = {name: value.format(**known) for name, value in headers.items()}
    assert status(served.address + place.format(**known), filled, method) == 403


def test_pages_of_other_ports_change_nothing(served: Served) -> None:
    """They are of the same site, so the browser sends this site's cookies along."""
    change = served.address + CREATE_MODEL
    for origin in ("http://127.0.0.1:9", "http://localhost:9", "null", "http://evil.example", ""):
        headers = {**served.cookie, **JSON, "Origin": origin}
        assert status(change, headers, "POST", MODEL) == 403, origin
    own = {**served.cookie, **JSON, "Origin": served.address.rstrip("/")}
    assert status(change, own, "POST", MODEL) == 200
    assert status(served.address, {**served.bearer, "Host": "evil.example"}) == 403


def test_nothing_can_be_uploaded(served: Served) -> None:
    files = sorted((served.project / "mlartifacts").rglob("*"))
    upload = f"{served.address}api/2.0/mlflow-artifacts/artifacts/models/evil.py"
    assert status(upload, served.bearer, "PUT", b"print('hello')") >= 400
    assert sorted((served.project / "mlartifacts").rglob("*")) == files


def test_clients_of_mlflow_bring_the_token(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    client = mlflow.MlflowClient(served.address)
    with pytest.raises(MlflowException, match="403.*MLFLOW_TRACKING_TOKEN"):
        client.search_experiments()
    monkeypatch.setenv("MLFLOW_TRACKING_TOKEN", served.token)
    assert "jumping-ant" in [experiment.name for experiment in client.search_experiments()]


def test_the_token_is_nowhere_that_others_can_look(served: Served) -> None:
    server = psutil.Process(served.process.pid)
    for process in (server, *server.children(recursive=True)):
        assert served.token not in " ".join(process.cmdline())
    for path in served.project.rglob("*"):
        assert not path.is_file() or served.token.encode() not in path.read_bytes()


def test_a_port_that_cannot_be_had_ends_in_one_line(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        for given in (port, 65536, -1):
            with pytest.raises(InputError, match=rf"^--port: given {given} \(.+\), allowed: .+$"):
                ui.run(tmp_path, given)


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
