"""What docs/how-it-works.md says of agents that are trained in turn, by the published seconds."""

import csv
import heapq
from collections.abc import Iterable

import committed
import pytest


def seconds(agent: str) -> list[float]:
    """Return what each seed took to train."""
    text = committed.text(f"results/timing/{agent}/timing.csv")
    last = {row["seed"]: float(row["seconds"]) for row in csv.DictReader(text.splitlines())}
    return list(last.values())


def makespan(jobs: Iterable[float], cores: int) -> float:
    """Return when the last job ends, if each begins as soon as a core is free."""
    free = [0.0] * cores
    for job in jobs:
        heapq.heapreplace(free, free[0] + job)
    return max(free)


@pytest.mark.parametrize(
    ("cores", "low", "high"),
    [(2, 1, 1.05), (4, 1, 1.05), (8, 1, 1.05), (16, 1, 1.05), (32, 1.7, 1.9)],
)
def test_mixing_agents_saves_little_on_fewer_cores_than_seeds(
    cores: int, low: float, high: float
) -> None:
    each = [seconds(agent) for agent in ("dqn", "sac", "pgpe")]
    in_turn = sum(makespan(own, cores) for own in each)
    mixed = makespan(sorted(sum(each, []), reverse=True), cores)
    assert low <= in_turn / mixed <= high
