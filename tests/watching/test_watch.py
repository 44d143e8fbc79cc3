"""Watching a policy: served to this machine alone, in real time, ended by Ctrl-C in one line."""

import os
import re
import shutil
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
from urllib.parse import parse_qs

import numpy as np
import psutil
import pytest
import rerun as rr
from browser import OpenPage
from other_user import as_nobody, needs_root, ports_connected_to, status
from recorded import Content, rerun_cli
from small_project import measures, write_csv

from jumping_ant.actions import ActionSet
from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import params_file
from jumping_ant.experiment.models import Params
from jumping_ant.policies import policy_file
from jumping_ant.policies.blind import UniformPolicy
from jumping_ant.sim.env import RobotEnv
from jumping_ant.sim.world import World
from jumping_ant.watching import server, watch
from jumping_ant.watching.feed import Feed
from jumping_ant.watching.live import LiveRecording, Step
from jumping_ant.watching.playing import play

ROOT = Path(__file__).resolve().parents[2]


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "jumping_ant.watching.watch", *arguments]


@pytest.fixture
def project(tmp_path: Path, robot_xml: str) -> Path:
    """A project in which only `random` is trained, with seeds 0 and 5; the latter is better."""
    shutil.copytree(ROOT / "jumping_ant", tmp_path / "jumping_ant")
    shutil.copy(ROOT / "params.yaml", tmp_path)
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "edited.xml").write_text(robot_xml, encoding="utf-8")
    for seed in (0, 5):
        folder = tmp_path / "models" / "random" / f"seed-{seed}"
        folder.mkdir(parents=True)
        policy = UniformPolicy(seed, ActionSet(), 8).to_bytes()
        (folder / "policy.zip").write_bytes(policy_file.owned(policy, ("random", seed)))
    means = [{"agent": "random", "seed": seed} | measures(10.0 + seed) for seed in (0, 5)]
    write_csv(Paths(tmp_path).agent("random").seed_means, means)
    return tmp_path


def test_the_best_seed_is_shown(project: Path) -> None:
    settings = params_file.load(project / "params.yaml")
    assert watch.best_seed(project, settings, "random") == 5
    said = "sac/seeds.csv: No such file or directory; run `dvc repro evaluate@sac`"
    with pytest.raises(InputError, match=said):
        watch.best_seed(project, settings, "sac")


def test_seeds_that_are_not_trained_are_refused(project: Path) -> None:
    policy = watch.load_policy(project, "random", 5)
    policy.start([0])
    assert policy.act(np.zeros((1, 27))).shape == (1, 8)
    with pytest.raises(InputError, match="seed of random: given 3, allowed: 0, 5$"):
        watch.load_policy(project, "random", 3)
    with pytest.raises(InputError, match="given 0, allowed: none yet; `dvc repro train@sac`"):
        watch.load_policy(project, "sac", 0)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["nobody"], "error: agent: given 'nobody', allowed: random, "),
        (["random", "--seed", "77"], "error: seed of random: given 77, allowed: 0, 5"),
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
    steps = list(play(env, UniformPolicy(0, ActionSet(), 8), first_seed=9, num_episodes=2))
    assert time.monotonic() - begin >= 8 * 0.05
    assert len(steps) == 8
    env.reset(seed=10)
    np.testing.assert_array_equal(steps[4].qpos, env.data.qpos)


def test_what_is_streamed_is_the_simulation(
    robot_xml: str, known_params: Params, tmp_path: Path
) -> None:
    """Every simulation step, the end of a control step being the start of the next."""
    world = World(robot_xml, known_params.env)
    env = RobotEnv(world)
    path = tmp_path / "live.rrd"
    played = []
    with rr.RecordingStream("test", send_properties=False) as stream:
        stream.save(path)
        recording = LiveRecording(stream, world)
        env.reset(seed=3)
        for number in range(3):
            qpos, qvel = env.data.qpos.copy(), env.data.qvel.copy()
            torques = np.full(8, 0.5 - 0.1 * number)
            reward = env.step(torques.astype(np.float32))[1]
            recording.show(Step(qpos, qvel, torques, reward, {"torso_height": reward}))
            played.append((qpos[2], reward))
    chunks = Content(path).moving["/height/torso"]
    rows = [chunk.to_record_batch() for chunk in chunks]
    assert [row.column("control_step").to_pylist() for row in rows] == [[k] * 6 for k in range(3)]
    times = np.concatenate([row.column("sim_time").cast("int64").to_pylist() for row in rows])
    np.testing.assert_array_equal(np.unique(times), 10_000_000 * np.arange(16))
    heights = [row.column("Scalars:scalars").to_pylist() for row in rows]
    assert [height[0][0] for height in heights] == [height for height, _ in played]
    assert heights[0][-1][0] == pytest.approx(played[1][0], abs=1e-6)


def texts(batches: list[bytes], folder: Path) -> list[str]:
    """The texts in what Rerun makes of a feed, those that do not change first."""
    (folder / "content.rrd").write_bytes(b"".join(batches))
    merged = folder / "merged.rrd"
    done = rerun_cli("merge", "-o", merged, folder / "content.rrd", home=folder)
    assert done.returncode == 0, done.stderr
    found = Content(merged)
    chunks = [*found.still["/text"], *found.moving["/text"]]
    rows = [chunk.to_record_batch().column("TextLog:text").to_pylist() for chunk in chunks]
    return [text for (text,) in sum(rows, [])]


def test_a_feed_gives_all_readers_the_first_batch_and_the_latest(tmp_path: Path) -> None:
    with rr.RecordingStream("test", send_properties=False) as stream:
        memory = 50_000
        feed = Feed(stream, memory)
        early: list[bytes] = []
        reader = threading.Thread(target=lambda: early.extend(feed.follow()), daemon=True)
        reader.start()
        stream.log("text", rr.TextLog("always"), static=True)
        feed.publish()
        for number in range(20):
            stream.set_time("number", sequence=number)
            stream.log("text", rr.TextLog(f"number {number}"))
            feed.publish()
            deadline = time.monotonic() + 10
            while len(early) < number + 2:
                assert time.monotonic() < deadline, "what is published arrives"
                time.sleep(0.001)
        feed.end()
        reader.join(10)
        late = list(feed.follow())
    numbers = [f"number {number}" for number in range(20)]
    assert texts(early, tmp_path) == ["always", *numbers]
    found = texts(late, tmp_path)
    assert found[0] == "always" and 1 < len(found) < 21 and found[1:] == numbers[1 - len(found) :]
    assert sum(map(len, late[1:])) <= memory


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """The address of a live recording, in which nothing happens after its beginning."""
    with server.serve("a name") as (stream, feed, address):
        stream.log("text", rr.TextLog("always"), static=True)
        feed.publish()
        yield address


def code(address: str, request: bytes) -> int:
    """Send bytes, and return the status of the answer, of which old HTTP has no line."""
    with socket.create_connection(place(address), timeout=10) as client:
        client.sendall(request)
        answer = client.recv(1000)
    found = re.search(rb"^HTTP/1.0 (\d+) |Error code: (\d+)", answer)
    assert found, (request[:40], answer)
    return int(found[1] or found[2])


def place(address: str) -> tuple[str, int]:
    host, port = address.split("/")[2].split(":")
    return host, int(port)


def test_any_bytes_are_answered_without_a_word_here(
    address: str, capfd: pytest.CaptureFixture[str]
) -> None:
    host, token = address.split("/")[2:4]
    paths = [b"/\xc3\xa9", b"/\xff\xfe", b"/\x01\x1b[2J", b"/%00", b"//evil.example/", b"/" * 999]
    paths += [path % token.encode() for path in (b"/%s", b"/%s/..", b"/%s/\xe9", b"/%s/x/live.rrd")]
    paths += [b"http://evil.example/", b"*", b"evil.example:80", b"/" + b"a" * 60_000]
    for path in paths:
        request = b"GET %s HTTP/1.1\r\nHost: %s\r\n\r\n" % (path, host.encode())
        assert code(address, request) in (400, 403, 404), path[:40]
    for request, expected in [
        (b"\x16\x03\x01\x02\x00\x01\r\n", 400),
        (b"\xff\xfe\r\n\r\n", 400),
        (b"GET / HTTP/9.9\r\n\r\n", 505),
        (b"PRI * HTTP/2.0\r\n\r\n", 505),
        (b"GET /" + b"a" * 70_000 + b" HTTP/1.1\r\n\r\n", 414),
        (b"GET / HTTP/1.1\r\nHost: " + b"a" * 70_000 + b"\r\n\r\n", 431),
        (b"GET / HTTP/1.1\r\n" + b"a: b\r\n" * 200 + b"\r\n", 431),
        (b"GET / HTTP/1.1\r\nHost: \xff\x00\r\n\r\n", 421),
        (b"GET / HTTP/1.1\r\n\r\n", 421),
        (b"POST / HTTP/1.1\r\nHost: %s\r\n\r\n" % host.encode(), 501),
    ]:
        assert code(address, request) == expected, request[:40]
    with socket.create_connection(place(address)) as client:  # and hangs up at once
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        client.sendall(b"GET / HT")
    assert status(address) == 200
    assert capfd.readouterr().err == ""


def test_only_the_address_opens_the_viewer(address: str) -> None:
    root, _, query = address.partition("?")
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[0-9a-f]{32}/", root)
    assert parse_qs(query)["url"] == [f"{root}live.rrd"]
    for name in ("", "live.rrd", "re_viewer.js"):
        unknown = f"http://127.0.0.1:{place(address)[1]}/{name}"
        assert status(unknown) == status(f"{root[:-2]}/{name}") == 403
    assert status(root.rstrip("/")) == status(f"{root}other") == 404
    assert status(address, {"Host": "evil.example"}) == 421, "a name that stands for this machine"
    with urllib.request.urlopen(address, timeout=10) as page:
        assert b"re_viewer" in page.read()
        assert page.headers["Content-Security-Policy"].startswith("default-src 'self' ")
        assert "http" not in page.headers["Content-Security-Policy"]
    with urllib.request.urlopen(f"{root}re_viewer_bg.wasm", timeout=10) as program:
        assert program.headers["Content-Type"] == "application/wasm"
        assert program.read(4) == b"\0asm"


@needs_root
def test_nobody_else_is_answered(address: str) -> None:
    assert status(address) == 200
    for known in (address, address.partition("?")[0] + "live.rrd"):
        assert isinstance(as_nobody(status, known), str), "no status"
    _, port = place(address)
    with socket.create_connection(place(address)):
        claims = [{"X-Forwarded-For": f"127.0.0.1:{other}"} for other in ports_connected_to(port)]
        assert claims
        assert all(isinstance(as_nobody(status, address, claim), str) for claim in claims)


def test_so_many_are_answered_at_a_time(address: str) -> None:
    """Connections that say nothing hold no more than their share of threads."""
    with ExitStack() as stack:
        for _ in range(server.MOST_CONNECTIONS):
            stack.enter_context(socket.create_connection(place(address)))
        one_more = stack.enter_context(socket.create_connection(place(address)))
        one_more.settimeout(10)
        assert one_more.recv(1) == b"", "closed"
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
    address = re.match(
        r"random, seed 5: open (http://127\.0\.0\.1:\d+/\S+) \(Ctrl-C ends it\)$", line
    )
    assert address, line + watching.communicate()[1]
    family = [psutil.Process(watching.pid)]
    family += family[0].children(recursive=True)
    listening = [
        connection.laddr
        for process in family
        for connection in process.net_connections()
        if connection.status == psutil.CONN_LISTEN
    ]
    assert listening == [place(address[1])]
    assert not any(address[1].split("/")[3] in " ".join(one.cmdline()) for one in family)
    with urllib.request.urlopen(parse_qs(address[1].partition("?")[2])["url"][0]) as live:
        assert live.read(2**20).startswith(b"RRF2"), "more than the first batch, so it grows"

    watching.send_signal(end)
    _, errors = watching.communicate(timeout=30)
    assert watching.returncode == 0
    assert errors.strip() == "ended"
    gone, alive = psutil.wait_procs(family, timeout=10)
    assert not alive


def test_the_viewer_loads_what_is_played(
    watching: subprocess.Popen[str], open_page: OpenPage
) -> None:
    assert watching.stdout is not None
    address = watching.stdout.readline().split()[4]
    visit = open_page(address)
    root = address.partition("?")[0]
    visit.wait_for("window._handle !== undefined", seconds=60)  # it has started
    deadline = time.monotonic() + 60
    while f"{root}live.rrd" not in visit.requests:
        assert time.monotonic() < deadline, visit.requests
        visit.page.wait_for_timeout(100)
    visit.page.wait_for_timeout(1000)
    assert not visit.page.evaluate("window._handle.has_panicked()"), visit.console_errors
    assert len(ports_connected_to(place(address)[1])) >= 1, "it still listens"
    assert visit.page_errors == []
