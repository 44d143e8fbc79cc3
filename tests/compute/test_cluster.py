"""Jobs on a Ray cluster that is started for the tests."""

import importlib.metadata
import multiprocessing
import os
import re
import signal
import tempfile
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
    die_once,
    fail,
    once_begun,
    tell,
    wait,
    wait_for_the_end,
)

from jumping_ant.base import machine
from jumping_ant.base.errors import InputError, StoppedError, WorkerError
from jumping_ant.compute import cluster, jobs


@pytest.mark.parametrize(
    ("name", "here"), [("mujoco", "3.0.0"), ("system", "Darwin arm64"), ("processor", "another")]
)
def test_a_machine_that_computes_otherwise_trains_nothing(
    on_cluster: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str, here: str
) -> None:
    there = cluster.kind()
    assert there["mujoco"] == importlib.metadata.version("mujoco")
    monkeypatch.setattr(cluster, "kind", lambda: there | {name: here})
    told = rf"^RAY_ADDRESS: given .* has {name} {there[name]}; allowed: {name} {here}, as here, .*$"
    with pytest.raises(InputError, match=told):
        collect({"trains": partial(wait_for_the_end, tmp_path, "trains")}, 2)
    assert not list(tmp_path.iterdir())


def test_a_cluster_gives_the_same(on_cluster: str) -> None:
    assert collect(COUNTS, 2) == EXPECTED
    with pytest.raises(InputError, match="a clear line"):
        collect({"good": partial(count, "x", 2), "bad": fail}, 2)


def test_what_is_computed_by_seed_has_a_worker_for_each(on_cluster: str) -> None:
    found = jobs.by_seed(tell, {3: "x", 1: "y"}, 0, "sac")
    assert [own[1:] for own in found] == [({3: "x"}, 1), ({1: "y"}, 1)]
    assert len({os.getpid(), *(own[0] for own in found)}) == 3
    (alone,) = jobs.by_seed(tell, {3: "x", 1: "y"}, 1, "sac")
    assert alone == (os.getpid(), {3: "x", 1: "y"}, machine.num_cores())


def test_another_worker_takes_over_a_seed(
    on_cluster: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert jobs.by_seed(partial(die_once, tmp_path), {3: "x", 1: "y"}, 0, "sac") == [["x"], ["y"]]
    told = capsys.readouterr().out
    for seed in (3, 1):
        assert re.search(rf"^sac: seed {seed}: its worker died \(.*another takes over$", told, re.M)


def test_a_signal_ends_what_cannot_be_resumed(on_cluster: str, tmp_path: Path) -> None:
    with (
        once_begun(tmp_path, 2, lambda: os.kill(os.getpid(), signal.SIGINT)),
        pytest.raises(StoppedError, match="the next run begins this stage anew"),
    ):
        jobs.by_seed(partial(wait, tmp_path), {3: "x", 1: "y"}, 0, "sac")


def loss(folder: Path) -> str:
    """Return the error of a cluster that is lost; a minute later, Ray may end this process."""
    cluster.SECONDS_LOST = 3.0
    waiting = {key: partial(wait_for_the_end, folder, key) for key in ("a", "b")}
    with pytest.raises(WorkerError) as caught:
        collect(waiting, 2)
    return str(caught.value)


def test_a_cluster_that_is_lost_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Ray itself ends its driver without a word."""
    port = small_ray.free_port()
    monkeypatch.setenv("RAY_ADDRESS", f"127.0.0.1:{port}")

    def lose() -> None:
        servers = psutil.Process(ray.pid).children(True)
        next(server for server in servers if server.name() == "gcs_server").kill()

    with (
        tempfile.TemporaryDirectory(prefix="ray") as folder,
        small_ray.started(folder, port) as ray,
        multiprocessing.get_context("spawn").Pool(1) as driver,
        once_begun(tmp_path, 2, lose),
    ):
        told = driver.apply(loss, (tmp_path,))
        assert re.match(r"the Ray cluster at 127.0.0.1:\d+ is lost; once", told)


@pytest.mark.parametrize("given", [None, "auto"])
def test_a_cluster_that_is_not_there_is_named_at_once(
    monkeypatch: pytest.MonkeyPatch, given: str | None
) -> None:
    """Nor is any cluster of this machine joined, which may be another user's."""
    address = given or f"127.0.0.1:{small_ray.free_port()}"
    monkeypatch.setenv("RAY_ADDRESS", address)
    expected = rf"RAY_ADDRESS: given '{address}', which cannot be joined \(nothing answers there\)"
    began = time.monotonic()
    with pytest.raises(InputError, match=expected):
        collect(COUNTS, 2)
    assert time.monotonic() - began < 20  # Ray takes minutes


@pytest.mark.parametrize(
    ("given", "address"), [("", None), ("local", None), ("10.0.0.1:6379", "10.0.0.1:6379")]
)
def test_which_values_name_a_cluster(
    monkeypatch: pytest.MonkeyPatch, given: str, address: str | None
) -> None:
    monkeypatch.setenv("RAY_ADDRESS", given)
    assert cluster.address() == address
