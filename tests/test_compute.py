from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from jumping_ant import compute
from jumping_ant.errors import InputError


def count(key: str, length: int) -> Iterator[str]:
    for number in range(length):
        yield f"{key}{number}"


def fail() -> Iterator[str]:
    yield "a start"
    raise InputError("a clear line")


@pytest.fixture(autouse=True)
def workers_find_this_file(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))


@pytest.mark.parametrize("workers", [1, 2])
def test_every_item_arrives_in_its_order(workers: int) -> None:
    jobs = {key: partial(count, key, length) for key, length in (("a", 3), ("b", 0), ("c", 5))}
    items: dict[str, list[str]] = {key: [] for key in jobs}
    for key, item in compute.stream(jobs, workers):
        items[key].append(item)
    assert items == {key: list(job()) for key, job in jobs.items()}


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_arrives_as_itself(workers: int) -> None:
    with pytest.raises(InputError, match="a clear line"):
        list(compute.stream({"good": partial(count, "x", 2), "bad": fail}, workers))


def test_num_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setattr("os.cpu_count", lambda: 8)
    assert compute.num_workers(0, num_jobs=4) == 4
    assert compute.num_workers(0, num_jobs=20) == 8
    assert compute.num_workers(3, num_jobs=20) == 3
    monkeypatch.setenv("RAY_ADDRESS", "cluster:6379")
    assert compute.num_workers(0, num_jobs=20) == 20


def test_no_core_stands_idle_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setattr("os.cpu_count", lambda: 4)
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
        list(compute.stream(jobs, 2))
