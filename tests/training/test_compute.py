"""Jobs in other processes: of this machine, and of a Ray cluster that is started for the tests."""

import importlib.metadata
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import psutil
import pytest

from jumping_ant.base import machine
from jumping_ant.base.errors import InputError, WorkerError
from jumping_ant.training import cluster, compute
from jumping_ant.training.workers import Work


def count(key: str, length: int, stop: threading.Event) -> Iterator[str]:
    for number in range(length):
        yield f"{key}{number}"


def fail(stop: threading.Event) -> Iterator[str]:
    yield "a start"
    raise InputError("a clear line")


def die(folder: Path, stop: threading.Event) -> Iterator[str]:
    """Kill this process with its first item on the way."""
    (folder / str(os.getpid())).touch()
    yield "a start"
    os.kill(os.getpid(), signal.SIGKILL)


def wait_for_the_end(folder: Path, key: str, stop: threading.Event) -> Iterator[str]:
    yield "begun"
    (folder / key).touch()
    assert stop.wait(60)
    yield "stopped"


@pytest.fixture(autouse=True, scope="module")
def workers_find_this_file() -> Iterator[None]:
    """Ray's workers, too, which do not have this process's `sys.path`, nor the user's token."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setenv("RAY_AUTH_MODE", "disabled")
        monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
        yield


@pytest.fixture(scope="module")
def ray_address(workers_find_this_file: None) -> Iterator[str]:
    """A cluster of one node."""
    port = free_port()
    with tempfile.TemporaryDirectory(prefix="ray") as folder, started_ray(folder, port):
        yield f"127.0.0.1:{port}"


@contextmanager
def started_ray(folder: str, port: int) -> Iterator[subprocess.Popen[bytes]]:
    command = [
        *(str(Path(sys.executable).with_name("ray")), "start", "--head", "--block"),
        *("--node-ip-address", "127.0.0.1", "--port", str(port), "--num-cpus", "2"),
        *("--include-dashboard", "false", "--temp-dir", folder),
        *("--object-store-memory", str(100 * 2**20)),
    ]
    process = subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        while not is_open(port):
            assert process.poll() is None
            time.sleep(0.1)
        yield process
    finally:
        everybody = [psutil.Process(process.pid), *psutil.Process(process.pid).children(True)]
        for one in everybody:
            with suppress(psutil.Error):
                one.kill()
        psutil.wait_procs(everybody, timeout=10)
        process.wait()


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port: int = server.getsockname()[1]
    return port


def is_open(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


@pytest.fixture
def no_cluster(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RAY_ADDRESS", raising=False)


@pytest.fixture
def on_cluster(monkeypatch: pytest.MonkeyPatch, ray_address: str) -> str:
    monkeypatch.setenv("RAY_ADDRESS", ray_address)
    return ray_address


def collect(jobs: Mapping[str, Work], workers: int) -> dict[str, list[Any]]:
    items: dict[str, list[Any]] = {key: [] for key in jobs}
    for key, item in compute.stream(
        lambda key: jobs[key], list(jobs), workers, name="job {}".format
    ):
        items[key].append(item)
    return items


COUNTS: dict[str, Work] = {
    key: partial(count, key, length) for key, length in (("a", 3), ("b", 0), ("c", 5))
}


EXPECTED = {key: list(job(threading.Event())) for key, job in COUNTS.items()}


@pytest.mark.usefixtures("no_cluster")
def test_every_item_arrives_in_its_order() -> None:
    assert collect(COUNTS, 1) == EXPECTED


class Stages:
    """Keys of which there may be none at the moment."""

    def __init__(self) -> None:
        self.ready = ["a", "b"]

    def __iter__(self) -> "Stages":
        return self

    def __next__(self) -> str:
        if not self.ready:
            raise StopIteration
        return self.ready.pop(0)


@pytest.mark.usefixtures("no_cluster")
@pytest.mark.parametrize("workers", [1, 2, 3])
def test_keys_may_follow_from_items(workers: int) -> None:
    keys, found = Stages(), []
    for key, item in compute.stream(lambda key: partial(count, key, 1), keys, workers):
        found.append(item)
        if len(key) < 3:
            keys.ready.append(f"{key}x")
    assert sorted(found) == ["a0", "ax0", "axx0", "b0", "bx0", "bxx0"]


@pytest.mark.usefixtures("no_cluster")
@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_arrives_as_itself(workers: int) -> None:
    with pytest.raises(InputError, match="a clear line"):
        collect({"good": partial(count, "x", 2), "bad": fail}, workers)


@pytest.mark.usefixtures("no_cluster")
def test_a_worker_that_dies_is_replaced_until_the_job_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(compute, "MAX_DEATHS", 1)
    with pytest.raises(WorkerError, match=r"job dying: its worker died 2 times \(SIGKILL\)"):
        collect({"good": partial(count, "x", 1), "dying": partial(die, tmp_path)}, 2)
    told = capsys.readouterr().out
    assert told == "job dying: its worker died (SIGKILL), and another takes over\n"
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.usefixtures("no_cluster")
def test_a_process_that_cannot_be_started_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: object) -> None:
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr("multiprocessing.context.SpawnProcess.start", refuse)
    with pytest.raises(WorkerError, match="no worker can be started: Resource temporarily"):
        collect(COUNTS, 2)


@pytest.mark.usefixtures("no_cluster")
@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_asks_for_an_end(tmp_path: Path, workers: int, number: signal.Signals) -> None:
    """Whoever runs finishes in order, and whoever waits does not begin."""
    before = signal.getsignal(number)
    jobs = {key: partial(wait_for_the_end, tmp_path, key) for key in ("a", "b", "c")}

    def send() -> None:
        while len(list(tmp_path.iterdir())) < workers:
            time.sleep(0.01)
        for child in psutil.Process().children():  # as of Ctrl-C, which all processes get
            child.send_signal(number)
        os.kill(os.getpid(), number)

    sender = threading.Thread(target=send)
    sender.start()
    items = collect(jobs, workers)
    sender.join()
    assert list(items.values()) == [["begun", "stopped"]] * workers + [[]] * (3 - workers)
    assert signal.getsignal(number) == before


DRIVER = """
import sys, threading
from functools import partial
from pathlib import Path
import test_compute
from jumping_ant.training import compute

if __name__ == "__main__":
    start = lambda key: partial(test_compute.wait_for_the_end, Path(sys.argv[1]), key)
    for _ in compute.stream(start, ["a", "b"], 2):
        print("item", flush=True)
"""


@pytest.fixture
def driver(tmp_path: Path, no_cluster: None) -> Iterator[subprocess.Popen[bytes]]:
    """A process with two workers that wait."""
    (tmp_path / "driver.py").write_text(DRIVER, encoding="utf-8")
    (tmp_path / "begun").mkdir()
    command = [sys.executable, str(tmp_path / "driver.py"), str(tmp_path / "begun")]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        yield process
        process.kill()


def test_workers_end_with_their_driver(driver: subprocess.Popen[bytes]) -> None:
    """However it ends: a kill gives it no time to tell them."""
    assert driver.stdout
    for _ in range(2):
        assert driver.stdout.readline() == b"item\n"
    workers = psutil.Process(driver.pid).children()
    driver.kill()
    assert psutil.wait_procs(workers, timeout=10)[1] == []


@pytest.mark.usefixtures("no_cluster")
def test_every_item_of_two_workers_arrives_and_nothing_listens() -> None:
    """Neither on the network nor at a path, from the start of the first to the end of the last."""
    found, has_ended = set(), threading.Event()

    def look() -> None:
        while not has_ended.wait(0.02):
            for process in psutil.Process().children(recursive=True):
                with suppress(psutil.Error):  # it has ended
                    found.update(
                        connection.laddr
                        for connection in process.net_connections(kind="all")
                        if connection.status == psutil.CONN_LISTEN
                        or isinstance(connection.laddr, str)
                    )

    looker = threading.Thread(target=look)
    looker.start()
    assert collect(COUNTS, 2) == EXPECTED
    has_ended.set()
    looker.join()
    assert found <= {""}, "socket pairs have no name"


# Prints each path in shared folders that belongs to a user and that this process, of another, can
# write to: what lies there it could replace.
OUTSIDER = """
import os, sys, time
user, known, places = int(sys.argv[1]), set(), sys.argv[2:]
def look():
    for place in places:
        for folder, folders, files in os.walk(place):
            for path in (os.path.join(folder, name) for name in folders + files):
                try:
                    is_his = os.lstat(path).st_uid == user and not os.path.islink(path)
                except OSError:
                    continue
                if is_his and path not in known and os.access(path, os.W_OK):
                    known.add(path)
                    print(path, flush=True)
look()
print("before", flush=True)
while True:
    look()
    time.sleep(0.01)
"""


@pytest.mark.skipif(os.getuid() != 0, reason="only root can become another user")
@pytest.mark.usefixtures("no_cluster")
def test_another_user_finds_nothing_to_replace() -> None:
    """From the start of the first worker to the end of the last, in all folders that all share."""
    python = shutil.which("python3", path="/usr/bin:/usr/local/bin")  # others cannot run ours
    if python is None:
        pytest.skip("no Python that other users can run")
    places = [place for place in ("/tmp", "/dev/shm") if Path(place).is_dir()]
    command = [python, "-c", OUTSIDER, str(os.getuid()), *places]
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        encoding="utf-8",
        cwd="/",
        user="nobody",
        group="nogroup",
        extra_groups=[],
    ) as outsider:
        assert outsider.stdout
        while outsider.stdout.readline() != "before\n":
            assert outsider.poll() is None
        assert collect(COUNTS, 2) == EXPECTED
        time.sleep(0.2)
        outsider.kill()
        assert outsider.stdout.read() == ""


def test_num_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setattr("jumping_ant.base.machine.num_cores", lambda: 8)
    assert compute.num_workers(0, num_jobs=4) == 4
    assert compute.num_workers(0, num_jobs=0) == 1
    assert compute.num_workers(0, num_jobs=20) == 8
    assert compute.num_workers(3, num_jobs=20) == 3
    monkeypatch.setenv("RAY_ADDRESS", "cluster:6379")
    assert compute.num_workers(0, num_jobs=20) == 20


def test_no_core_stands_idle_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setattr("jumping_ant.base.machine.num_cores", lambda: 4)
    assert compute.num_threads(0, num_jobs=1) == [4]
    assert compute.num_threads(0, num_jobs=3) == [1, 1, 1]
    assert compute.num_threads(0, num_jobs=6) == [1, 1, 1, 1, 2, 2]
    assert compute.num_threads(0, num_jobs=8) == [1] * 8
    assert compute.num_threads(2, num_jobs=3) == [1, 1, 2]
    assert compute.num_threads(1, num_jobs=3) == [1, 1, 1]


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
    monkeypatch.setattr(compute, "MAX_DEATHS", 1)
    with pytest.raises(WorkerError, match="job dying: its worker died 2 times"):
        collect({"dying": partial(die, tmp_path), "waits": partial(count, "x", 1)}, 2)
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize("server", ["gcs_server", "raylet"])
def test_a_cluster_that_is_lost_is_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, server: str
) -> None:
    """Ray itself waits for a raylet for ever, and ends its driver without the other server."""
    monkeypatch.setattr(cluster, "SECONDS_LOST", 3.0)
    port = free_port()
    monkeypatch.setenv("RAY_ADDRESS", f"127.0.0.1:{port}")
    jobs = {key: partial(wait_for_the_end, tmp_path, key) for key in ("a", "b")}

    def lose() -> None:
        while len(list(tmp_path.iterdir())) < 2:
            time.sleep(0.01)
        (victim,) = (one for one in psutil.Process(ray.pid).children(True) if one.name() == server)
        victim.kill()

    with (
        tempfile.TemporaryDirectory(prefix="ray") as folder,
        started_ray(folder, port) as ray,
    ):
        loser = threading.Thread(target=lose)
        loser.start()
        with pytest.raises(WorkerError, match=r"the Ray cluster at 127.0.0.1:\d+ is lost; once"):
            collect(jobs, 2)
        loser.join()


def test_a_cluster_that_is_not_there_is_named_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    address = f"127.0.0.1:{free_port()}"
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
