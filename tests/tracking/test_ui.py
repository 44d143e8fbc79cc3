"""`make ui`: MLflow's pages are this user's alone, and what they show is what was trained."""

import http.client
import os
import re
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import mlflow
import psutil
import pytest
from browser import OpenPage
from mlflow.exceptions import MlflowException
from other_user import as_nobody, needs_root, ports_connected_to, status
from playwright.sync_api import expect
from tracked_project import AGGREGATES, copy_tracked, query, tracked, unset_variables

from jumping_ant.base.errors import InputError
from jumping_ant.tracking import ui

RUN = """
import pathlib, sys
from jumping_ant.tracking import ui
ui.PROJECT_ROOT = pathlib.Path(sys.argv.pop(1))
ui.main()
"""
# What would have uvicorn believe whom a request says it comes from.
MISLEADING = {"FORWARDED_ALLOW_IPS": "*", "UVICORN_PROXY_HEADERS": "1", "WEB_CONCURRENCY": "2"}
CREATE_MODEL = "api/2.0/mlflow/registered-models/create"
MODEL = b'{"name": "evil"}'
JSON = {"Content-Type": "application/json"}


@dataclass(frozen=True)
class Served:
    """A running `make ui`.

    Attributes:
        printed: The address that it printed.
        process: It.
    """

    printed: str
    process: subprocess.Popen[str]

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


@contextmanager
def running(project: Path) -> Iterator[Served]:
    process = subprocess.Popen(
        [sys.executable, "-c", RUN, str(project), "--port", "0"],
        cwd=project,
        env=os.environ | MISLEADING,
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
        yield Served(printed.split()[2], process)
    finally:
        process.terminate()
        process.communicate(timeout=30)


@pytest.fixture(scope="module")
def own_project(tmp_path_factory: pytest.TempPathFactory, tracked_template: Path) -> Path:
    """A tracked project, whose database the tests here may add to."""
    root = tmp_path_factory.mktemp("served") / "a project"
    copy_tracked(tracked_template, root)
    return root


@pytest.fixture(scope="module")
def served(own_project: Path) -> Iterator[Served]:
    with pytest.MonkeyPatch.context() as monkeypatch:
        unset_variables(monkeypatch)
        with running(own_project) as served:
            yield served
            served.process.send_signal(signal.SIGINT)
            _, errors = served.process.communicate(timeout=30)
            assert (served.process.returncode, errors) == (0, ""), "Ctrl-C ends it without a word"


def test_only_the_address_opens_the_pages(served: Served) -> None:
    address = served.address
    assert re.fullmatch(
        r"http://127\.0\.0\.1:\d+/\?token=[0-9a-f]{32}#/experiments/1/.+", served.printed
    )
    with urllib.request.urlopen(served.printed.partition("#")[0], timeout=30) as entrance:
        assert b"location.replace" in entrance.read()
        cookie = entrance.headers["Set-Cookie"]
    assert cookie.startswith(served.cookie["Cookie"] + ";")
    assert "HttpOnly" in cookie and "samesite=lax" in cookie.lower()
    assert status(address, served.cookie) == status(address, served.bearer) == 200
    for headers in (
        {},
        {"Cookie": f"jumping-ant-{served.port}="},
        {"Cookie": f"jumping-ant-{served.port + 1}={served.token}"},
        {"Cookie": f"jumping-ant-{served.port}={served.token[:-1]}\xe9"},
        {"Authorization": f"Basic {served.token}"},
        {"Authorization": "Bearer "},
    ):
        assert status(address, headers) == 403
    for place in (
        "?token=",
        "?token=%C3%A9%00",
        f"?Token={served.token}",
        "health",
        "%2e%2e/",
        "%2f",
    ):
        assert status(address + place) == 403, place
    for method in ("HEAD", "OPTIONS", "POST", "DELETE", "STRANGE"):
        assert status(address, method=method) == 403, method
    with pytest.raises(urllib.error.HTTPError) as caught:
        urllib.request.urlopen(address, timeout=30)
    told = caught.value.read().decode()
    assert told.startswith("Open the address that `make ui` printed") and told.count("\n") == 1


@needs_root
def test_nobody_else_is_answered_whatever_is_sent(served: Served, own_project: Path) -> None:
    """Other users see from which ports this one is connected, and may know the token, too."""
    before = query(own_project, "SELECT name FROM registered_models")
    pages = http.client.HTTPConnection("127.0.0.1", served.port, timeout=30)
    pages.request("GET", "/", headers=served.cookie)
    assert pages.getresponse().status == 200

    def attack() -> dict[str, int]:
        claims = [f"127.0.0.1:{port}" for port in ports_connected_to(served.port)]
        assert claims, "no connection to take for one's own"
        found = {}
        for claim in ["", "127.0.0.1", *claims]:
            for header in ("X-Forwarded-For", "X-Real-IP", "Forwarded", "X-Client-IP"):
                value = f"for={claim}" if header == "Forwarded" else claim
                for secret in ({}, served.cookie, served.bearer):
                    headers = {header: value, **secret, **JSON}
                    known = f"{header}: {value} {secret}"
                    found[known] = status(served.address, headers)
                    place = served.address + CREATE_MODEL
                    found[f"{known} change"] = status(place, headers, "POST", MODEL)
        return found

    found = as_nobody(attack)
    assert len(found) >= 3 * 4 * 3 * 2 and set(found.values()) == {403}, found
    pages.close()
    assert query(own_project, "SELECT name FROM registered_models") == before


def test_pages_of_other_ports_are_not_answered(served: Served) -> None:
    """They are of the same site, so the browser sends this site's cookies along."""
    change = served.address + CREATE_MODEL
    foreign = "http://127.0.0.1:9"
    for origin in (foreign, "http://localhost:9", "null", "http://evil.example", ""):
        headers = {**served.cookie, **JSON, "Origin": origin}
        assert status(change, headers, "POST", MODEL) == 403, origin
    image = {**served.cookie, "Sec-Fetch-Site": "same-site", "Sec-Fetch-Mode": "no-cors"}
    assert status(served.address, image) == 403
    for site in ("same-site", "cross-site"):
        link = image | {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "navigate"}
        assert status(served.address, link) == 200, "a link"
        assert status(served.address, link | {"Sec-Fetch-Dest": "document"}) == 200, "a link"
        for other in ("iframe", "frame", "object", "embed"):
            assert status(served.address, link | {"Sec-Fetch-Dest": other}) == 403, other
        assert status(change, link | JSON, "POST", MODEL) == 403, "a form"
    own = {**served.cookie, **JSON, "Origin": served.address.rstrip("/")}
    assert status(change, own | {"Sec-Fetch-Site": "same-origin"}, "POST", MODEL) == 200
    assert status(served.address, {**served.bearer, "Host": "evil.example"}) == 403


def test_no_websocket_opens(served: Served) -> None:
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13"}
    upgrade["Sec-WebSocket-Key"] = "dGhlIHNhbXBsZSBub25jZQ=="
    assert status(served.address, upgrade) == 403
    assert status(served.address, upgrade | served.cookie) == 200, "a page, as without the upgrade"


def test_nothing_can_be_uploaded(served: Served, own_project: Path) -> None:
    files = sorted((own_project / "mlartifacts").rglob("*"))
    upload = f"{served.address}api/2.0/mlflow-artifacts/artifacts/models/evil.py"
    assert status(upload, served.bearer, "PUT", b"print('hello')") >= 400
    assert sorted((own_project / "mlartifacts").rglob("*")) == files


def test_clients_of_mlflow_bring_the_token(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    client = mlflow.MlflowClient(served.address)
    with pytest.raises(MlflowException, match="403.*MLFLOW_TRACKING_TOKEN"):
        client.search_experiments()
    monkeypatch.setenv("MLFLOW_TRACKING_TOKEN", served.token)
    assert "jumping-ant" in [experiment.name for experiment in client.search_experiments()]


def test_the_token_is_nowhere_that_others_can_look(served: Served, own_project: Path) -> None:
    family = [psutil.Process(served.process.pid)]
    family += family[0].children(recursive=True)
    assert not any(served.token in " ".join(process.cmdline()) for process in family)
    for path in own_project.rglob("*"):
        assert not path.is_file() or served.token.encode() not in path.read_bytes()


def test_a_port_that_cannot_be_had_ends_in_one_line(project: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        for given in (port, 65536, -1):
            with pytest.raises(InputError, match=rf"^--port: given {given} \(.+\), allowed: .+$"):
                ui.run(project, given)


def test_the_printed_address_shows_the_table_of_runs(served: Served, open_page: OpenPage) -> None:
    visit = open_page(served.printed)
    visit.page.wait_for_url(lambda address: served.token not in address)
    shown = visit.page.get_by_role("link", name=AGGREGATES[0])
    expect(shown).to_be_visible()
    assert "#/experiments/1/runs" in visit.page.url
    assert visit.page.evaluate("document.cookie") == "", "out of reach of what pages run"
    visit.page.reload()
    expect(shown).to_be_visible()


def test_links_in_the_report_open_the_pages(
    served: Served, tmp_path: Path, open_page: OpenPage
) -> None:
    """Once the printed address has been opened in this browser; the report is a file."""
    visit = open_page(served.printed)
    visit.page.wait_for_url(lambda address: served.token not in address)
    report = tmp_path / "report.html"
    report.write_text(f'<a href="{visit.page.url}">the runs</a>', encoding="utf-8")
    visit.page.goto(report.as_uri())
    visit.page.click("a")
    expect(visit.page.get_by_role("link", name=AGGREGATES[0])).to_be_visible()


def test_a_model_whose_files_were_changed_is_replaced(untracked_project: Path) -> None:
    project = untracked_project
    tracked(project)
    path = next((project / "mlartifacts" / "models").rglob("serving.py"))
    other, expected = path.parent / "numpy.py", path.read_text(encoding="utf-8")
    for change in (
        lambda: path.write_text(expected + "\nprint('hello')\n", encoding="utf-8"),
        lambda: other.write_text("print('hello')\n", encoding="utf-8"),
        path.unlink,
    ):
        assert tracked(project)[-1].endswith("4 unchanged")
        change()
        lines = tracked(project)
        assert lines[-1].endswith("1 repaired, 3 unchanged")
        assert any("models 1" in line for line in lines)
        assert path.read_text(encoding="utf-8") == expected and not other.exists()
    assert tracked(project)[-1].endswith("4 unchanged")
