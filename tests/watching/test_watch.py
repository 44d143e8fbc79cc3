"""Watching a policy: served to this machine alone, in real time, ended by Ctrl-C in one line."""

import json
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

import numpy as np
import psutil
import pytest
from browser import OpenPage
from other_user import as_nobody, needs_root, ports_connected_to, status
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from jumping_ant.actions import ActionSet
from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import params_file
from jumping_ant.experiment.models import Params
from jumping_ant.policies.blind import UniformPolicy
from jumping_ant.sim.env import RobotEnv
from jumping_ant.sim.world import World
from jumping_ant.watching import server, trained
from jumping_ant.watching.playing import play


def placed(robot: str = "edited", agent: str = "pgpe", seed: int = 30) -> str:
    """The message that places a robot."""
    start = {"seed": 1, "qpos": [0, 0, 0.75, 1] + 11 * [0], "qvel": 14 * [0]}
    policy = {"agent": agent, "seed": seed}
    message = {"kind": "place", "slot": 0, "robot": robot, "policy": policy, "start": start}
    return json.dumps(message)


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "jumping_ant.watching.watch", *arguments]


def test_the_best_seed_is_first_and_others_are_refused(project: Path) -> None:
    settings = params_file.load(project / "params.yaml")
    assert trained.seeds(project, settings, "random") == [35, 30]
    policy = trained.load(project, settings, "random", 35)
    policy.start([0])
    assert policy.act(np.zeros((1, 27))).shape == (1, 8)
    with pytest.raises(InputError, match="seed of random: given 31, allowed: 30, 35$"):
        trained.load(project, settings, "random", 31)
    with pytest.raises(InputError, match="given 30, allowed: none yet; `dvc repro train@sac`"):
        trained.load(project, settings, "sac", 30)
    with pytest.raises(InputError, match="agent: given '../random', allowed: random, "):
        trained.load(project, settings, "../random", 30)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["nobody"], "error: agent: given 'nobody', allowed: random, "),
        (["random", "--seed", "77"], "error: seed of random: given 77, allowed: 30, 35"),
        (["sac"], "error: seed of sac: given 30, allowed: none yet; `dvc repro train@sac`"),
        (["random", "--episodes", "0"], "error: --episodes: given 0, allowed: 1 or more"),
    ],
)
def test_bad_input_ends_in_one_line(project: Path, arguments: list[str], line: str) -> None:
    done = subprocess.run(command(*arguments), cwd=project, capture_output=True, encoding="utf-8")
    assert done.returncode == 2
    assert done.stderr.startswith(line) and done.stderr.count("\n") == 1


def test_a_screen_that_is_not_there_ends_in_one_line(project: Path) -> None:
    environment = os.environ | {"DISPLAY": ":98765", "WAYLAND_DISPLAY": ""}
    done = subprocess.run(
        command("random"), cwd=project, env=environment, capture_output=True, encoding="utf-8"
    )
    assert done.returncode == 2
    assert done.stderr.startswith("error: display: no window opens here (")
    assert done.stderr.count("\n") == 1


def test_a_policy_plays_in_real_time(robot_xml: str, known_params: Params) -> None:
    short = known_params.env.model_copy(update={"max_episode_steps": 4})
    env = RobotEnv(World(robot_xml, short))
    begin = time.monotonic()
    policy = UniformPolicy(0, ActionSet(), 8)
    rewards = list(play(env, policy, first_seed=9, num_episodes=2))
    assert time.monotonic() - begin >= 8 * 0.05
    assert len(rewards) == 8
    assert rewards[4:] == list(play(env, policy, first_seed=10, num_episodes=1))


@pytest.fixture(scope="module")
def address(project: Path) -> Iterator[str]:
    """The address of a page."""
    with server.listen(project, params_file.load(project / "params.yaml")) as (serving, address):
        threading.Thread(target=serving.serve_forever, daemon=True).start()
        yield address


def code(address: str, request: bytes) -> int:
    """Send bytes, and return the status of the answer, or 0 if there is none."""
    with socket.create_connection(place(address), timeout=10) as client:
        client.sendall(request)
        with suppress(ConnectionResetError):
            answer = client.recv(1000)
            return int(answer.split()[1]) if answer else 0
    return 0


def place(address: str) -> tuple[str, int]:
    host, port = address.split("/")[2].split(":")
    return host, int(port)


def test_any_bytes_are_answered_without_a_word_here(
    address: str, capfd: pytest.CaptureFixture[str]
) -> None:
    host, token = address.split("/")[2:4]
    paths = [b"/\xc3\xa9", b"/\xff\xfe", b"/\x01\x1b[2J", b"/%00", b"//evil.example/", b"/" * 999]
    paths += [path % token.encode() for path in (b"/%s", b"/%s/..", b"/%s/\xe9", b"/%s/x/live")]
    paths += [b"http://evil.example/", b"*", b"evil.example:80", b"/" + b"a" * 60_000]
    for path in paths:
        request = b"GET %s HTTP/1.1\r\nHost: %s\r\n\r\n" % (path, host.encode())
        assert code(address, request) in (0, 403, 404, 414), path[:40]
    for request, expected in [
        (b"\x16\x03\x01\x02\x00\x01\r\n", 0),
        (b"\xff\xfe\r\n\r\n", 0),
        (b"GET / HTTP/9.9\r\n\r\n", 0),
        (b"PRI * HTTP/2.0\r\n\r\n", 0),
        (b"GET /" + b"a" * 70_000 + b" HTTP/1.1\r\n\r\n", 414),
        (b"GET / HTTP/1.1\r\nHost: " + b"a" * 70_000 + b"\r\n\r\n", 431),
        (b"GET / HTTP/1.1\r\n" + b"a: b\r\n" * 200 + b"\r\n", 431),
        (b"GET / HTTP/1.1\r\nHost: \xff\x00\r\n\r\n", 0),
        (b"GET / HTTP/1.1\r\n\r\n", 421),
        (b"GET / HTTP/1.1\r\nHost: a\r\nHost: %s\r\n\r\n" % host.encode(), 421),
        (b"GET /%s/live HTTP/1.1\r\nHost: %s\r\n\r\n" % (token.encode(), host.encode()), 426),
    ]:
        assert code(address, request) == expected, request[:40]
    with socket.create_connection(place(address)) as client:  # and hangs up at once
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        client.sendall(b"GET / HT")
    assert status(address) == 200
    assert capfd.readouterr().err == ""


def test_only_the_address_opens_the_page(address: str) -> None:
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[0-9a-f]{32}/", address)
    for name in ("", "live", "policies/pgpe/30.json"):
        unknown = f"http://127.0.0.1:{place(address)[1]}/{name}"
        assert status(unknown) == status(f"{address[:-2]}/{name}") == 403
    for name in ("other", "policies/pgpe/31.json", "policies/../params.yaml"):
        assert status(address.rstrip("/")) == status(address + name) == 404
    assert status(address, {"Host": "evil.example"}) == 421, "a name that stands for this machine"
    with urllib.request.urlopen(address + "policies/pgpe/30.json", timeout=10) as policy:
        assert json.load(policy)["kind"] == "network"
        assert policy.headers["Referrer-Policy"] == "no-referrer"


def test_a_policy_that_is_trained_anew_can_be_had_later(
    address: str, project: Path, open_page: OpenPage, capfd: pytest.CaptureFixture[str]
) -> None:
    """`dvc repro` removes it before it trains it."""
    visit = open_page(address + "#a=random.35.0", width=390, height=420)
    visit.wait_for("Boolean(window.page?.hasMoved)")
    path = Paths(project).agent("pgpe").seed(30).policy
    policy = path.read_bytes()
    for content, told in [(None, "No such file"), (policy[:99], "policy.zip: ")]:
        path.unlink()
        if content is not None:
            path.write_bytes(content)
        try:
            assert status(address + "policies/pgpe/30.json") == 404
            visit.page.select_option("#agent-a", "pgpe")
            visit.wait_for(f"document.getElementById('status').textContent.includes('{told}')")
            visit.wait_for("document.getElementById('agent-a').value === 'random'")
            assert visit.page.inner_text("#name-a") == "random"
        finally:
            path.write_bytes(policy)
    visit.page.select_option("#agent-a", "pgpe")
    visit.wait_for("document.getElementById('name-a').textContent === 'PGPE'")
    assert visit.page_errors == []
    assert capfd.readouterr().err == ""


def test_only_its_own_page_opens_the_simulator(address: str) -> None:
    live, host = address.replace("http", "ws") + "live", address.split("/")[2]
    for origin in (None, "null", f"https://{host}", "http://127.0.0.1:9", "http://evil.example"):
        with pytest.raises(InvalidStatus, match="403"):
            connect(live, origin=origin, proxy=None)
    with connect(live, origin=f"http://{host}", proxy=None) as own:
        assert json.loads(own.recv(timeout=10))["kind"] == "ready"


@pytest.mark.parametrize(
    ("message", "said"),
    [
        ("{", "Expecting property name"),
        ("[]", "'str' object cannot"),
        ('{"kind": "simulation"}', "simulation"),
        ('{"kind": "run", "running": true}', "'speed'"),
        ('{"kind": "push", "force": [1, 2]}', r"given \[1, 2\], allowed: 3 numbers"),
        (placed(seed=31), "seed of pgpe: given 31, allowed: 30$"),
        (placed(agent="../pgpe"), "agent: given '../pgpe', allowed: random, "),
        (placed(robot="../edited"), "edited"),
    ],
)
def test_what_no_page_says_ends_its_conversation_alone(
    address: str, message: str, said: str, capfd: pytest.CaptureFixture[str]
) -> None:
    live, host = address.replace("http", "ws") + "live", address.split("/")[2]
    with connect(live, origin=f"http://{host}", proxy=None) as own:
        assert json.loads(own.recv(timeout=10))["kind"] == "ready"
        own.send(placed())
        assert json.loads(own.recv(timeout=10))["kind"] == "robot"
        assert json.loads(own.recv(timeout=10))["kind"] == "frame"
        own.send(message)
        answer = json.loads(own.recv(timeout=10))
        assert answer["kind"] == "failure" and re.search(said, answer["text"])
        with pytest.raises(ConnectionClosed):
            own.recv(timeout=10)
    assert status(address) == 200
    assert capfd.readouterr().err == ""


@needs_root
def test_nobody_else_is_answered(address: str) -> None:
    assert status(address) == 200
    for known in (address, address + "live"):
        assert isinstance(as_nobody(status, known), str), "no status"
    _, port = place(address)
    with socket.create_connection(place(address)):
        claims = [{"X-Forwarded-For": f"127.0.0.1:{other}"} for other in ports_connected_to(port)]
        assert claims
        assert all(isinstance(as_nobody(status, address, claim), str) for claim in claims)


def test_so_many_are_answered_at_a_time(address: str) -> None:
    """Connections that say nothing hold no more than their share of threads, for a moment."""
    with ExitStack() as stack:
        for _ in range(2 * server.MOST_THREADS):
            stack.enter_context(socket.create_connection(place(address)))
        end = time.monotonic() + 1
        while time.monotonic() < end:
            assert threading.active_count() < 1.5 * server.MOST_THREADS
            time.sleep(0.01)
    deadline = time.monotonic() + 10
    while True:
        with suppress(OSError):
            assert status(address) == 200
            return
        assert time.monotonic() < deadline


@pytest.fixture
def watching(project: Path) -> Iterator[subprocess.Popen[str]]:
    """A policy that plays where there is no screen."""
    screens = ("DISPLAY", "WAYLAND_DISPLAY")
    environment = {key: value for key, value in os.environ.items() if key not in screens}
    process = subprocess.Popen(
        command("random"),
        cwd=project,
        # A proxy, as companies have, stands between this machine and others, not within it.
        env=environment | {"HOME": str(project), "http_proxy": "http://127.0.0.1:9"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        # Shells have what they run in the background ignore Ctrl-C, these tests perhaps.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    yield process
    if process.poll() is None:
        process.terminate()
        process.wait(30)


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
def test_it_plays_to_one_port_of_this_machine(
    watching: subprocess.Popen[str], end: signal.Signals
) -> None:
    assert watching.stdout is not None
    line = watching.stdout.readline()
    found = re.match(
        r"random, seed 35: open (http://127\.0\.0\.1:\d+/\w+/)#a=random\.35\.0 \(Ctrl-C ends it\)$",
        line,
    )
    assert found, line + watching.communicate()[1]
    address = found[1]
    process = psutil.Process(watching.pid)
    assert process.children() == []
    listening = [
        connection.laddr
        for connection in process.net_connections()
        if connection.status == psutil.CONN_LISTEN
    ]
    assert listening == [place(address)]
    stack = ExitStack()  # a page that is open, and a connection that says nothing
    live, host = address.replace("http", "ws") + "live", address.split("/")[2]
    stack.enter_context(connect(live, origin=f"http://{host}", proxy=None))
    stack.enter_context(socket.create_connection(place(address)))

    watching.send_signal(end)
    with stack:
        _, errors = watching.communicate(timeout=30)
    assert watching.returncode == 0
    assert errors.strip() == "ended"


def test_the_page_shows_and_touches_the_native_simulator(
    watching: subprocess.Popen[str], open_page: OpenPage
) -> None:
    assert watching.stdout is not None
    address = watching.stdout.readline().split()[4].replace("random.35", "metronome.30")
    visit = open_page(address, width=390, height=420)
    page = visit.page
    visit.wait_for("Boolean(window.page?.hasMoved)")
    visit.wait_for("document.getElementById('origin-a').textContent.endsWith('recomputed here')")
    assert page.inner_text("#name-a") == "metronome" and page.is_visible("#game")
    height = "page.plots.histories[0].at(-1).height"
    before = page.evaluate(height)
    visit.wait_for(f"Math.abs({height} - {before}) > 0.05")

    page.click("#run")
    page.wait_for_timeout(200)
    steps = page.evaluate("page.frames[0].steps")
    page.click("#step")
    visit.wait_for(f"page.frames[0].steps === {steps} + 1")
    page.select_option("#agent-a", "pgpe")  # it stands nearly still
    page.select_option("#speed", "4")
    page.select_option("#strength", "160")
    page.click("#push-forward")
    page.click("#run")
    visit.wait_for("page.frames[0].current.torso[0] > 1")
    page.evaluate("page.perturb({ gravity: 0, slope: 30 }, true)")
    page.click("#push-up")
    visit.wait_for("page.frames[0].current.torso[2] > 2")
    page.evaluate("page.pull(0, [0, 0, 0.5])")
    visit.wait_for("page.frames[0].current.torso[2] < 1.5")
    page.select_option("#agent-b", "you, with keys 1 to 5")
    page.evaluate("page.command(3)")
    visit.wait_for("String(page.plots.histories[1].at(-1)?.torques) === '1,1,1,1,-1,-1,-1,-1'")
    page.evaluate("page.game.seconds = 2")
    page.click("#game-start")
    visit.wait_for("document.getElementById('game-result').textContent.includes('metronome')")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390, "it scrolls sideways"

    watching.send_signal(signal.SIGINT)
    assert watching.wait(30) == 0
    visit.wait_for("document.getElementById('failure').textContent.includes('has ended')")
    root = address.partition("#")[0]
    assert {request.removeprefix(root) for request in visit.requests} == {
        "",
        *(f"policies/{name}/30.json" for name in ("metronome", "pgpe")),
    }
    assert visit.console_errors == visit.page_errors == []
