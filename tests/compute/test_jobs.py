"""Jobs inline, and in other processes of this machine."""

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path

import psutil
import pytest
from small_jobs import COUNTS, EXPECTED, collect, count, die, fail, tell, wait_for_the_end

from jumping_ant.base.errors import InputError, WorkerError
from jumping_ant.compute import jobs


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
    for key, item in jobs.stream(lambda key: partial(count, key, 1), keys, workers):
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
    monkeypatch.setattr(jobs, "MAX_DEATHS", 1)
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
    waiting = {key: partial(wait_for_the_end, tmp_path, key) for key in ("a", "b", "c")}

    def send() -> None:
        while len(list(tmp_path.iterdir())) < workers:
            time.sleep(0.01)
        for child in psutil.Process().children():  # as of Ctrl-C, which all processes get
            child.send_signal(number)
        os.kill(os.getpid(), number)

    sender = threading.Thread(target=send)
    sender.start()
    items = collect(waiting, workers)
    sender.join()
    assert list(items.values()) == [["begun", "stopped"]] * workers + [[]] * (3 - workers)
    assert signal.getsignal(number) == before


DRIVER = """
import sys, threading
from functools import partial
from pathlib import Path
import small_jobs
from jumping_ant.compute import jobs

if __name__ == "__main__":
    start = lambda key: partial(small_jobs.wait_for_the_end, Path(sys.argv[1]), key)
    for _ in jobs.stream(start, ["a", "b"], 2):
        print("item", flush=True)
"""


@pytest.fixture
def driver(tmp_path: Path, no_cluster: None) -> Iterator[subprocess.Popen[bytes]]:
    """A process with two workers that wait."""
    (tmp_path / "driver.py").write_text(DRIVER, encoding="utf-8")
    (tmp_path / "begun").mkdir()
    command = [sys.executable, str(tmp_path / "driver.py"), str(tmp_path / "begun")]
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    ) as process:
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


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_reaches_all_processes_and_only_the_driver_decides(
    driver: subprocess.Popen[bytes], number: signal.Signals
) -> None:
    """Also the first worker, with which Python starts a helper of its own."""
    assert driver.stdout
    for _ in range(2):
        assert driver.stdout.readline() == b"item\n"
    os.killpg(driver.pid, number)
    assert driver.stdout.read() == b"item\n" * 2, "each job stops in order"
    assert driver.wait(60) == 0


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


@pytest.mark.usefixtures("no_cluster")
def test_what_is_computed_by_seed_is_computed_at_once_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("jumping_ant.base.machine.num_cores", lambda: 8)
    given = {3: "x", 1: "y"}
    assert jobs.by_seed(tell, given, 0, "sac") == [(os.getpid(), given, 8)]


def test_num_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setattr("jumping_ant.base.machine.num_cores", lambda: 8)
    assert jobs.num_workers(0, num_jobs=4) == 4
    assert jobs.num_workers(0, num_jobs=0) == 1
    assert jobs.num_workers(0, num_jobs=20) == 8
    assert jobs.num_workers(3, num_jobs=20) == 3
    monkeypatch.setenv("RAY_ADDRESS", "cluster:6379")
    assert jobs.num_workers(0, num_jobs=20) == 20


def test_no_core_stands_idle_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setattr("jumping_ant.base.machine.num_cores", lambda: 4)
    assert jobs.num_threads(0, num_jobs=1) == [4]
    assert jobs.num_threads(0, num_jobs=3) == [1, 1, 1]
    assert jobs.num_threads(0, num_jobs=6) == [1, 1, 1, 1, 2, 2]
    assert jobs.num_threads(0, num_jobs=8) == [1] * 8
    assert jobs.num_threads(2, num_jobs=3) == [1, 1, 2]
    assert jobs.num_threads(1, num_jobs=3) == [1, 1, 1]
