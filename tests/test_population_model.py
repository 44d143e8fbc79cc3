"""The model of a population on many hosts, and what docs/cluster.md says of it."""

import json
from dataclasses import replace

import pytest

from jumping_ant.base import machine
from scripts import publish
from soak import cluster, population
from soak.population import Alone, Measured, Model, Rounds

# 2 ms a step, 10 us of work for all on one core, 5 ms a generation, 1 ms a call, 1 MB/s.
MODEL = Model(
    *(2e-3, 1e-5, 5e-3, 1e-3, 1e6),
    down=900.0,
    back=100.0,
    up=100.0,
    real_cores=machine.num_cores(),
    crowding=1.25,
)
ELSEWHERE = replace(MODEL, real_cores=8, crowding=1.0)


def test_a_generation_takes_what_its_parts_take() -> None:
    """11 policies on 3 cores: 4 on the first, which is the seed's own, and 7 elsewhere."""
    assert MODEL.moved(3, 11, 50) == 7 * (1000 + 100 * 50)
    assert ELSEWHERE.seconds(3, 11, 50) == pytest.approx(
        {"episodes": 4 * 0.1, "serial": 0.005 + 11 * 0.0005, "calls": 0.002, "moves": 0.042}
    )
    assert MODEL.moved(1, 11, 50) == 0


def test_hosts_of_one_machine_share_its_cores() -> None:
    """Three on two cores, each of which is slower by a quarter when both work."""
    crowded = replace(ELSEWHERE, real_cores=2, crowding=1.25)
    one, two, three = (crowded.seconds(hosts, 12, 50)["episodes"] for hosts in (1, 2, 3))
    assert (one, two, three) == pytest.approx((1.2, 0.6 * 1.25, 0.4 * 1.5 * 1.25))


def test_the_model_is_found_from_what_it_predicts() -> None:
    steps = population.STEPS
    rounds = Rounds({1: 3e-3, 2: 4e-3, 3: 5e-3}, full=3e-3 + 2.0, size=2_000_000)
    ones = [
        Alone(
            size, sum(MODEL.seconds(1, size, steps).values()) - 2e-3 * steps * size, 900, 100, 100
        )
        for size in (40, 1000)
    ]
    hosts, size = population.FITTED
    seconds = sum(MODEL.seconds(hosts, size, steps).values())
    found = population.fitted(rounds, ones, [Measured(hosts, size, seconds, 0.0, "")], 1.25)
    assert vars(found) == pytest.approx(vars(MODEL))


def test_the_fastest_generation_counts_and_bytes_are_of_all() -> None:
    lines = [
        {"rounds": {"1": 0.1}, "full": 0.2, "bytes": 5},
        *({"population": 8, "seconds": seconds} for seconds in (9.0, 11.0, 12.0, 15.0)),
        {"population": 8, "policy": "a"},
    ]
    counts = iter((100, 400, 500, 700))
    rounds, measured = population.read(lines, 2, lambda: next(counts))
    assert rounds == Rounds({1: 0.1}, 0.2, 5)
    assert measured == [Measured(2, 8, seconds=1.0, moved=200.0, policy="a")]


def test_the_document_has_the_committed_figures() -> None:
    """`python -m soak.cluster population` writes both."""
    figures = json.loads(cluster.PATH.read_text(encoding="utf-8"))["population"]
    assert publish.section(cluster.PAGE, "population") == population.table(figures).rstrip()
