"""Parts of a job's work on other cores of a Ray cluster that is started for the tests."""

import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import small_ray
from small_parts import (
    SIZE,
    Answers,
    squares,
    squares_nevertheless,
    squares_of_one_kind,
    squares_without_cores,
)

from jumping_ant.compute import jobs
from jumping_ant.compute.cluster_parts import ClusterSpread

CORES = 3


@pytest.fixture(autouse=True, scope="module")
def ray_cluster(workers_find_the_jobs: None) -> Iterator[None]:
    """A cluster of one node."""
    port = small_ray.free_port()
    with (
        pytest.MonkeyPatch.context() as monkeypatch,
        tempfile.TemporaryDirectory(prefix="ray") as folder,
        small_ray.started(folder, port, CORES),
    ):
        monkeypatch.setenv("RAY_ADDRESS", f"127.0.0.1:{port}")
        yield


def answers(*works: Any) -> list[Answers]:
    return [item for _, item in jobs.stream(works.__getitem__, range(len(works)), len(works))]


def processes(answer: Answers) -> int:
    """Return how many processes answered; what they did is checked."""
    assert [number for _, own in answer for number in own] == [row**2 for row in range(SIZE)]
    assert max(len(own) for _, own in answer) - min(len(own) for _, own in answer) <= 1
    return len({process for process, _ in answer})


def test_a_lonely_job_has_all_cores_and_of_several_each_its_share() -> None:
    (alone,) = answers(partial(squares, ClusterSpread(1)))
    assert processes(alone) == CORES
    (one_of_two,) = answers(partial(squares, ClusterSpread(2)))
    assert processes(one_of_two) == 1


def test_cores_that_others_hold_are_not_waited_for() -> None:
    """More jobs than cores, of which each would like all, all end."""
    found = [processes(answer) for answer in answers(*[squares_without_cores] * (CORES + 1))]
    assert len(found) == CORES + 1


def test_what_a_lost_part_was_to_do_others_do(tmp_path: Path) -> None:
    before, after = answers(partial(squares_nevertheless, tmp_path / "mark"))
    assert processes(before) == processes(after) == CORES - 1


def test_a_machine_that_computes_otherwise_has_no_part() -> None:
    (answer,) = answers(squares_of_one_kind)
    assert processes(answer) == 1
