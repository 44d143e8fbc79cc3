import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import psutil
import pytest
import ray

from jumping_ant.base.errors import InputError, WorkerError
from jumping_ant.training import compute
from jumping_ant.training.compute import Job


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
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
        yield


def collect(jobs: Mapping[str, Job], workers: int) -> dict[str, list[Any]]:
    items: dict[str, list[Any]] = {key: [] for key in jobs}
    for key, item in compute.stream(
        lambda key: jobs[key], list(jobs), workers, name="job {}".format
    ):
        items[key].append(item)
    return items


COUNTS: dict[str, Job] = {
    key: partial(count, key, length) for key, length in (("a", 3), ("b", 0), ("c", 5))
}


@pytest.fixture(scope="module")
def on_ray() -> dict[str, list[Any]]:
    """The items of jobs on Ray, and what can be seen from there: starting it takes seconds."""
    return collect({**COUNTS, "addresses": look_around, "token": tell_its_address}, 2)


def test_every_item_arrives_in_its_order(on_ray: dict[str, list[Any]]) -> None:
    expected = {key: list(job(threading.Event())) for key, job in COUNTS.items()}
    assert collect(COUNTS, 1) == expected
    assert {key: on_ray[key] for key in COUNTS} == expected


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_arrives_as_itself(workers: int) -> None:
    with pytest.raises(InputError, match="a clear line"):
        collect({"good": partial(count, "x", 2), "bad": fail}, workers)


def test_a_worker_that_dies_is_replaced_until_the_job_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(compute, "MAX_DEATHS", 1)
    with pytest.raises(WorkerError, match="job dying: its worker died 2 times"):
        collect({"good": partial(count, "x", 1), "dying": partial(die, tmp_path)}, 2)
    assert "job dying: its worker died, and another takes over" in capsys.readouterr().out
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize(
    ("number", "workers"), [(signal.SIGINT, 1), (signal.SIGTERM, 1), (signal.SIGTERM, 2)]
)
def test_a_signal_asks_for_an_end(tmp_path: Path, workers: int, number: signal.Signals) -> None:
    """Whoever runs finishes in order, and whoever waits does not begin."""
    before = signal.getsignal(number)
    jobs = {key: partial(wait_for_the_end, tmp_path, key) for key in ("a", "b", "c")}

    def send() -> None:
        while len(list(tmp_path.iterdir())) < workers:
            time.sleep(0.01)
        os.kill(os.getpid(), number)

    sender = threading.Thread(target=send)
    sender.start()
    items = collect(jobs, workers)
    sender.join()
    assert list(items.values()) == [["begun", "stopped"]] * workers + [[]] * (3 - workers)
    if workers == 1:  # Ray leaves a handler of its own
        assert signal.getsignal(number) == before


def look_around(stop: threading.Event) -> Iterator[set[str]]:
    """Yield the addresses that Ray's processes listen on."""
    addresses = set()
    for process in psutil.Process().parent().parent().children(recursive=True):
        with suppress(psutil.Error):  # some last for a moment
            addresses |= {
                connection.laddr.ip
                for connection in process.net_connections(kind="tcp")
                if connection.status == psutil.CONN_LISTEN
            }
    yield addresses


def test_nobody_else_can_talk_to_ray(on_ray: dict[str, list[Any]]) -> None:
    (addresses,) = on_ray["addresses"]
    assert addresses
    assert {address.removeprefix("::ffff:") for address in addresses} == {"127.0.0.1"}


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


def test_a_cluster_that_cannot_be_joined_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ray itself takes minutes to give up on an address, so its answer is given here."""

    def refuse(**_: object) -> None:
        raise ConnectionError("version mismatch\nand more")

    monkeypatch.setenv("RAY_ADDRESS", "cluster:6379")
    monkeypatch.setattr("ray.init", refuse)
    jobs = {"a": partial(count, "a", 1), "b": partial(count, "b", 1)}
    expected = r"RAY_ADDRESS: given 'cluster:6379', which cannot be joined \(version mismatch\)"
    with pytest.raises(InputError, match=expected):
        collect(jobs, 2)


def tell_its_address(stop: threading.Event) -> Iterator[tuple[str, str]]:
    """Tell where Ray's servers listen, and the token that they ask for."""
    yield ray.get_runtime_context().gcs_address, os.environ["RAY_AUTH_TOKEN"]


OUTSIDER = """
import sys
from ray._raylet import GcsClient
print(len(GcsClient(address=sys.argv[1]).internal_kv_keys(b"", None)))
"""


def is_let_in(address: str, **environment: str) -> bool:
    """Tell whether a process that knows only the address can read what Ray keeps."""
    own = {key: value for key, value in os.environ.items() if not key.startswith("RAY_")}
    done = subprocess.run(
        [sys.executable, "-c", OUTSIDER, address],
        env=own | environment,
        capture_output=True,
        encoding="utf-8",
        timeout=60,
    )
    return done.returncode == 0 and int(done.stdout) > 0


def test_only_its_own_processes_may_talk_to_it(
    on_ray: dict[str, list[Any]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who can, runs code as this user. Ray would keep the token where others may read it."""
    monkeypatch.setenv("HOME", str(tmp_path))
    tokens = [token for _, token in on_ray["token"]]
    for key, (address, token) in compute.stream(lambda key: tell_its_address, ["a", "b"], 2):
        tokens.append(token)
        if key == "a":
            mode = {"RAY_AUTH_MODE": "token"}
            assert is_let_in(address, **mode, RAY_AUTH_TOKEN=token)
            assert not is_let_in(address, **mode, RAY_AUTH_TOKEN="0" * 64)
            assert not is_let_in(address)
            for process in psutil.process_iter(["cmdline"]):
                assert token not in " ".join(process.info["cmdline"] or ())
    assert len(tokens) == 3 and len(set(tokens)) == 2
    assert min(map(len, tokens)) >= 32
    assert not (tmp_path / ".ray").exists()
