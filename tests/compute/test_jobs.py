"""Jobs inline, and in other processes of this machine."""

import os
import signal
import stat
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path

import psutil
import pytest
import small_agents
from small_jobs import (
    COUNTS,
    EXPECTED,
    collect,
    count,
    die,
    fail,
    once_begun,
    send_back,
    tell,
    wait_for_the_end,
)

from jumping_ant.agents.job import Job
from jumping_ant.base.errors import InputError, WorkerError
from jumping_ant.compute import jobs
from jumping_ant.sim.world import World

pytestmark = pytest.mark.usefixtures("no_cluster")


@pytest.mark.parametrize("workers", [1, 2])
def test_items_and_errors_arrive(workers: int) -> None:
    assert collect(COUNTS, workers) == EXPECTED
    with pytest.raises(InputError, match="a clear line"):
        collect({"good": partial(count, "x", 2), "bad": fail}, workers)


def test_a_training_with_all_its_defaults_goes_to_another_process(robot_xml: str) -> None:
    world = World(robot_xml, small_agents.PARAMS.env)
    trainings = [Job(world, agent, seed=3) for agent in small_agents.agents().values()]
    assert collect({"all": partial(send_back, trainings)}, 2) == {"all": [trainings]}


def test_a_worker_that_dies_is_replaced_until_the_job_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(jobs, "MAX_DEATHS", 1)
    with pytest.raises(WorkerError, match=r"job dying: its worker died 2 times \(SIGKILL\)"):
        collect({"good": partial(count, "x", 1), "dying": partial(die, tmp_path)}, 2)
    told = capsys.readouterr().out
    assert told == "job dying: its worker died (SIGKILL), and another takes over\n"
    assert len(list(tmp_path.iterdir())) == 2


def test_a_process_that_cannot_be_started_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: object) -> None:
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr("multiprocessing.context.SpawnProcess.start", refuse)
    with pytest.raises(WorkerError, match="no worker can be started: Resource temporarily"):
        collect(COUNTS, 2)


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_asks_for_an_end(tmp_path: Path, workers: int, number: signal.Signals) -> None:
    """Whoever runs finishes in order, and whoever waits does not begin."""
    before = signal.getsignal(number)
    waiting = {key: partial(wait_for_the_end, tmp_path, key) for key in ("a", "b", "c")}

    def send() -> None:
        for child in psutil.Process().children():  # as of Ctrl-C, which all processes get
            child.send_signal(number)
        os.kill(os.getpid(), number)

    with once_begun(tmp_path, workers, send):
        items = collect(waiting, workers)
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
def driver(tmp_path: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A process with two workers that have begun, and wait."""
    (tmp_path / "driver.py").write_text(DRIVER, encoding="utf-8")
    (tmp_path / "begun").mkdir()
    command = [sys.executable, str(tmp_path / "driver.py"), str(tmp_path / "begun")]
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    ) as process:
        assert process.stdout
        assert [process.stdout.readline() for _ in range(2)] == [b"item\n"] * 2
        yield process
        process.kill()


def test_workers_end_with_their_driver(driver: subprocess.Popen[bytes]) -> None:
    """However it ends: a kill gives it no time to tell them."""
    workers = psutil.Process(driver.pid).children()
    driver.kill()
    assert psutil.wait_procs(workers, timeout=10)[1] == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_reaches_all_processes_and_only_the_driver_decides(
    driver: subprocess.Popen[bytes], number: signal.Signals
) -> None:
    """Also the first worker, with which Python starts a helper of its own."""
    os.killpg(driver.pid, number)
    assert driver.stdout and driver.stdout.read() == b"item\n" * 2, "each job stops in order"
    assert driver.wait(60) == 0


def reachable(known: set[Path]) -> Iterator[str]:
    """Yield sockets of workers that others can reach, and what others can write to."""
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):  # it has ended
            for connection in process.net_connections(kind="all"):
                if connection.status == psutil.CONN_LISTEN or isinstance(connection.laddr, str):
                    yield str(connection.laddr)
    for top in set(shared_folders()) - known:
        with suppress(OSError):  # it has been removed
            is_passable = top.lstat().st_mode & stat.S_IXOTH
            for path in (top, *top.rglob("*")) if is_passable else (top,):
                status = path.lstat()
                is_open = status.st_mode & stat.S_IWOTH and not stat.S_ISLNK(status.st_mode)
                if status.st_uid == os.getuid() and is_open:
                    yield str(path)


def shared_folders() -> list[Path]:
    return [path for place in ("/tmp", "/dev/shm") for path in Path(place).glob("*")]


def test_every_item_of_two_workers_arrives_and_nobody_else_reaches_them() -> None:
    """From the start of the first worker to the end of the last."""
    known, found, has_ended = set(shared_folders()), set(), threading.Event()

    def look() -> None:
        while not has_ended.wait(0.02):
            found.update(reachable(known))

    looker = threading.Thread(target=look)
    looker.start()
    assert collect(COUNTS, 2) == EXPECTED
    has_ended.set()
    looker.join()
    assert found <= {""}, "socket pairs have no name"


def test_what_is_computed_by_seed_is_computed_at_once_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("jumping_ant.base.machine.num_cores", lambda: 8)
    given = {3: "x", 1: "y"}
    assert jobs.by_seed(tell, given, 0, "sac") == [(os.getpid(), given, 8)]


def test_num_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("jumping_ant.base.machine.num_cores", lambda: 8)
    for requested, num_jobs, workers in ((0, 4, 4), (0, 0, 1), (0, 20, 8), (3, 20, 3)):
        assert jobs.num_workers(requested, num_jobs) == workers
    monkeypatch.setenv("RAY_ADDRESS", "cluster:6379")
    assert jobs.num_workers(0, num_jobs=20) == 20


def test_no_core_stands_idle_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("jumping_ant.base.machine.num_cores", lambda: 4)
    for threads in ([4], [1, 1, 1], [1, 1, 1, 1, 2, 2], [1] * 8):
        assert jobs.num_threads(0, num_jobs=len(threads)) == threads
    assert jobs.num_threads(2, num_jobs=3) == [1, 1, 2]
