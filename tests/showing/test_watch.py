"""Watching a policy: served to this machine alone, in real time, ended by Ctrl-C in one line."""

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

import numpy as np
import psutil
import pytest
import rerun as rr
from recorded import Content

from jumping_ant.actions import ActionSet
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import write_text
from jumping_ant.base.paths import Paths
from jumping_ant.experiment.models import Params
from jumping_ant.policies.blind import UniformPolicy
from jumping_ant.showing import watch
from jumping_ant.showing.playing import play
from jumping_ant.showing.recording import server
from jumping_ant.showing.recording.live import LiveRecording, Step
from jumping_ant.sim.env import RobotEnv

ROOT = Path(__file__).resolve().parents[2]


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "jumping_ant.showing.watch", *arguments]


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
        (folder / "policy.zip").write_bytes(UniformPolicy(seed, ActionSet(), 8).to_bytes())
    write_text(Paths(tmp_path).agent("random").seed_means, "seed,return\n0,10.0\n5,20.5\n")
    return tmp_path


def test_the_best_seed_is_shown(project: Path) -> None:
    assert watch.best_seed(project, "random") == 5
    said = "sac/seeds.csv: No such file or directory; run `dvc repro evaluate@sac`"
    with pytest.raises(InputError, match=said):
        watch.best_seed(project, "sac")


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
    env = RobotEnv(robot_xml, short)
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
    env = RobotEnv(robot_xml, known_params.env)
    path = tmp_path / "live.rrd"
    played = []
    with rr.RecordingStream("test", send_properties=False) as stream:
        stream.save(path)
        recording = LiveRecording(stream, env.model, known_params.env.frame_skip)
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


def answers_only_its_own_name(address: str) -> None:
    """A web page may have its name stand for this machine, and then ask as if for itself."""
    foreign = urllib.request.Request(address, headers={"Host": "evil.example"})
    with pytest.raises(urllib.error.HTTPError, match="421"):
        urllib.request.urlopen(foreign, timeout=10)


def answers_so_many_at_a_time(address: str) -> None:
    """Connections that say nothing hold no more than their share of threads."""
    host, port = address.split("/")[2].split(":")
    with ExitStack() as stack:
        for _ in range(server.MOST_CONNECTIONS):
            stack.enter_context(socket.create_connection((host, int(port))))
        one_more = stack.enter_context(socket.create_connection((host, int(port))))
        one_more.settimeout(10)
        assert one_more.recv(1) == b"", "closed"
    deadline = time.monotonic() + 10
    while True:
        with suppress(OSError), urllib.request.urlopen(address, timeout=10) as page:
            assert page.status == 200
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
def test_it_is_served_to_this_machine_alone(
    watching: subprocess.Popen[str], end: signal.Signals
) -> None:
    assert watching.stdout is not None
    line = watching.stdout.readline()
    address = re.match(
        r"random, seed 5: open (http://127\.0\.0\.1:\d+/\?url=\S+) \(Ctrl-C ends it\)$", line
    )
    assert address, line + watching.communicate()[1]
    family = [psutil.Process(watching.pid)]
    family += family[0].children(recursive=True)
    listening = {
        connection.laddr.ip
        for process in family
        for connection in process.net_connections()
        if connection.status == psutil.CONN_LISTEN
    }
    assert listening == {"127.0.0.1"}
    with urllib.request.urlopen(address[1], timeout=10) as page:
        assert b"re_viewer" in page.read()
        policy = page.headers["Content-Security-Policy"]
    assert set(re.findall(r"https?://[^ ;]+", policy)) <= set(
        re.findall(r"http://127\.0\.0\.1:\d+", policy)
    )
    assert policy.startswith("default-src 'self'")
    answers_only_its_own_name(address[1])
    answers_so_many_at_a_time(address[1])

    watching.send_signal(end)
    _, errors = watching.communicate(timeout=30)
    assert watching.returncode == 0
    assert errors.strip() == "ended"
    gone, alive = psutil.wait_procs(family, timeout=10)
    assert not alive
