"""Jobs on a Ray cluster that is started for the tests."""

import importlib.metadata
import multiprocessing
import os
import re
import signal
import socket
import tempfile
import threading
import time
from functools import partial
from pathlib import Path

import psutil
import pytest
import small_ray
from small_jobs import (
    COUNTS,
    EXPECTED,
    collect,
    count,
    die,
    die_once,
    fail,
    tell,
    wait,
    wait_for_the_end,
)

from jumping_ant.base import machine
from jumping_ant.base.errors import InputError, StoppedError, WorkerError
from jumping_ant.compute import cluster, jobs


def test_a_cluster_gives_the_same(on_cluster: str) -> None:
    assert collect(COUNTS, 2) == EXPECTED


def test_an_error_on_a_cluster_arrives_as_itself(on_cluster: str) -> None:
    with pytest.raises(InputError, match="a clear line"):
        collect({"good": partial(count, "x", 2), "bad": fail}, 2)


@pytest.mark.parametrize(
    ("name", "here"), [("mujoco", "3.0.0"), ("system", "Darwin arm64"), ("processor", "another")]
)
def test_a_machine_that_computes_otherwise_trains_nothing(
    on_cluster: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str, here: str
) -> None:
    there = cluster.kind()
    monkeypatch.setattr(cluster, "kind", lambda: there | {name: here})
    told = rf"^RAY_ADDRESS: given .* has {name} {there[name]}; allowed: {name} {here}, as here, .*$"
    with pytest.raises(InputError, match=told):
        collect({"trains": partial(wait_for_the_end, tmp_path, "trains")}, 2)
    assert not list(tmp_path.iterdir())


def test_a_machine_without_a_package_computes_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "PACKAGES", ("mujoco", "no-such-package"))
    told = cluster.kind()
    assert told["mujoco"] == importlib.metadata.version("mujoco")
    assert told["no-such-package"] == "missing"


def test_a_worker_of_a_cluster_is_replaced(
    on_cluster: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(jobs, "MAX_DEATHS", 1)
    with pytest.raises(WorkerError, match="job dying: its worker died 2 times"):
        collect({"dying": partial(die, tmp_path), "waits": partial(count, "x", 1)}, 2)
    assert len(list(tmp_path.iterdir())) == 2


def test_what_is_computed_by_seed_has_a_worker_for_each(on_cluster: str) -> None:
    found = jobs.by_seed(tell, {3: "x", 1: "y"}, 0, "sac")
    assert [own[1:] for own in found] == [({3: "x"}, 1), ({1: "y"}, 1)]
    assert len({os.getpid(), *(own[0] for own in found)}) == 3
    for given, requested in (({3: "x"}, 0), ({3: "x", 1: "y"}, 1)):
        (alone,) = jobs.by_seed(tell, given, requested, "sac")
        assert alone == (os.getpid(), given, machine.num_cores())


def test_another_worker_takes_over_a_seed(
    on_cluster: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert jobs.by_seed(partial(die_once, tmp_path), {3: "x", 1: "y"}, 0, "sac") == [["x"], ["y"]]
    told = capsys.readouterr().out
    for seed in (3, 1):
        assert re.search(rf"^sac: seed {seed}: its worker died \(.*another takes over$", told, re.M)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_what_cannot_be_resumed(
    on_cluster: str, tmp_path: Path, number: signal.Signals
) -> None:
    def send() -> None:
        while len(list(tmp_path.iterdir())) < 2:
            time.sleep(0.01)
        os.kill(os.getpid(), number)

    sender = threading.Thread(target=send)
    sender.start()
    with pytest.raises(StoppedError, match="the next run begins this stage anew"):
        jobs.by_seed(partial(wait, tmp_path), {3: "x", 1: "y"}, 0, "sac")
    sender.join()


def loss(folder: Path, seems_there: bool) -> str:
    """Return what is said of a cluster that is lost; a minute later, Ray may end this process."""
    cluster.SECONDS_LOST = 3.0
    if seems_there:
        cluster._answers = lambda address: True
    waiting = {key: partial(wait_for_the_end, folder, key) for key in ("a", "b")}
    with pytest.raises(WorkerError) as caught:
        collect(waiting, 2)
    return str(caught.value)


@pytest.mark.parametrize(
    ("server", "seems_there"),
    [("gcs_server", False), ("raylet", False), ("gcs_server", True)],
)
def test_a_cluster_that_is_lost_is_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, server: str, seems_there: bool
) -> None:
    """Ray itself waits for a raylet for ever, and ends its driver without the other server.

    A server that is lost after it answered, and before Ray asks it, seems to be there.
    """
    port = small_ray.free_port()
    monkeypatch.setenv("RAY_ADDRESS", f"127.0.0.1:{port}")

    def lose() -> None:
        while len(list(tmp_path.iterdir())) < 2:
            time.sleep(0.01)
        (victim,) = (one for one in psutil.Process(ray.pid).children(True) if one.name() == server)
        victim.kill()

    with (
        tempfile.TemporaryDirectory(prefix="ray") as folder,
        small_ray.started(folder, port) as ray,
        multiprocessing.get_context("spawn").Pool(1) as driver,
    ):
        loser = threading.Thread(target=lose)
        loser.start()
        told = driver.apply(loss, (tmp_path, seems_there))
        assert re.match(r"the Ray cluster at 127.0.0.1:\d+ is lost; once", told)
        loser.join()


def test_a_cluster_that_is_not_there_is_named_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    address = f"127.0.0.1:{small_ray.free_port()}"
    monkeypatch.setenv("RAY_ADDRESS", address)
    expected = rf"RAY_ADDRESS: given '{address}', which cannot be joined \(nothing answers there\)"
    began = time.monotonic()
    with pytest.raises(InputError, match=expected):
        collect(COUNTS, 2)
    assert time.monotonic() - began < 20  # Ray takes minutes


@pytest.mark.parametrize(
    ("given", "address"),
    [("", None), ("local", None), ("auto", None), ("10.0.0.1:6379", "10.0.0.1:6379")],
)
def test_which_values_name_a_cluster(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, given: str, address: str | None
) -> None:
    monkeypatch.setenv("RAY_TMPDIR", str(tmp_path))
    monkeypatch.setenv("RAY_ADDRESS", given)
    assert cluster.address() == address


def test_the_cluster_of_this_machine_is_its_users_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("RAY_TMPDIR", str(tmp_path))
    monkeypatch.setenv("RAY_ADDRESS", "auto")
    noted = tmp_path / "ray" / "ray_current_cluster"
    noted.parent.mkdir()
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
        noted.write_text(address, encoding="utf-8")
        assert cluster.address() == address
        if os.getuid() == 0:
            os.chown(noted, 65534, -1)
            assert cluster.address() is None, "another user's"
            os.chown(noted, 0, -1)
    assert cluster.address() is None, "it does not run any more"
