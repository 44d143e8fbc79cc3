"""The claims that rest on seconds: each compares what docs/measures-and-claims.md says."""

from dataclasses import replace

import numpy as np
import pytest
from small_field import HEAVY, HIGH, PARALLEL, RANDOM, SLOW, agent, check, one_verdict, the_claim

from jumping_ant.comparison import timing as claims
from jumping_ant.params import presets

UNTIMED = dict.fromkeys(("pgpe", "sac", "dqn"), {})


@pytest.mark.parametrize(
    ("pace", "verdict"), [(9.0, "supported"), (0.2, "refuted"), (1.0, "inconclusive")]
)
def test_training_time_is_that_of_a_control_step(pace, verdict):
    sac, dqn = agent("sac", "sac", budget=500), agent("dqn", "dqn", budget=2000)
    slowed = {
        seed: curve | {"seconds": pace * curve["seconds"]} for seed, curve in sac.curves.items()
    }
    (claim,) = check(replace(sac, curves=slowed), dqn, table=claims.table(UNTIMED))
    assert (SLOW in claim["text"], claim["verdict"]) == (True, verdict)


@pytest.mark.parametrize(
    ("budget", "verdict"), [(9_000_000, "supported"), (200, "refuted"), (1_000_000, "inconclusive")]
)
def test_training_time_in_all_is_compared_with_the_articles_budgets(budget, verdict):
    sac = agent("sac", "sac", budget=budget, total_steps=100_000)
    dqn = agent("dqn", "dqn", budget=1_000_000, total_steps=1_000_000)
    assert one_verdict("in all", sac, dqn, table=claims.table(UNTIMED)) == verdict
    ours = agent("dqn", "dqn", budget=1_000_000, total_steps=210_000)
    texts = [claim["text"] for claim in check(sac, ours, table=claims.table(UNTIMED))]
    assert not any("in all" in text for text in texts)


def test_the_articles_budgets_are_those_of_its_preset():
    agents = presets.load("article").agents
    for name, steps in claims.ARTICLES_STEPS.items():
        assert agents[name].max_env_steps == steps


@pytest.mark.parametrize(
    ("reached_at", "verdict", "is_small"),
    [(100, "equivalent", True), (115, "supported", True), (140, "supported", False)],
)
def test_seconds_may_differ_by_a_quarter(reached_at, verdict, is_small):
    agents = agent("dqn", "dqn", HIGH), agent("pgpe", "pgpe", HIGH, reached_at), RANDOM
    claim = the_claim(HEAVY, *agents, table=claims.table(UNTIMED))
    assert claim["margin"] == {"low": 0.8, "high": 1.25}
    assert (claim["verdict"], claim["p_equivalence_adjusted"] < 0.05) == (verdict, is_small)


@pytest.mark.parametrize(
    ("reached_at", "verdict"), [(900, "supported"), (60, "refuted"), (100, "inconclusive")]
)
def test_effort_counts_the_seconds_until_something_is_learned(reached_at, verdict):
    agents = agent("sac", "sac", HIGH), agent("pgpe", "pgpe", HIGH, reached_at), RANDOM
    claim = the_claim(HEAVY, *agents, table=claims.table(UNTIMED))
    assert claim["verdict"] == verdict
    assert claim["plot"]["axis"].startswith("Training seconds to a return above")


@pytest.mark.parametrize(
    ("speed_up", "rivals", "verdict"),
    [(1.9, 1.1, "supported"), (1.0, 1.5, "refuted"), (1.5, 1.5, "inconclusive")],
)
def test_a_population_parallelises_if_cores_bring_more_than_to_one_policy(
    speed_up, rivals, verdict
):
    one = np.linspace(2.0, 2.1, 8)
    jitter = np.linspace(-0.02, 0.02, 8)
    scaling = {
        name: {1: one, 2: one / (factor + jitter)}
        for name, factor in (("pgpe", speed_up), ("sac", rivals))
    }
    agents = [agent(name, name) for name in scaling]
    assert one_verdict(PARALLEL, *agents, table=claims.table(scaling)) == verdict


def test_one_core_says_nothing_of_parallel_work():
    agents = [agent(name, name) for name in ("pgpe", "sac")]
    table = claims.table({one.name: {1: np.ones(8)} for one in agents})
    claim = the_claim(PARALLEL, *agents, table=table)
    assert (claim["verdict"], claim["effect"]["value"]) == ("inconclusive", None)


def test_they_are_corrected_among_themselves_and_left_out_without_their_agents():
    dqn, sac, pgpe = (agent(name, name) for name in ("dqn", "sac", "pgpe"))
    for agents, parts in [
        ((dqn, sac), [SLOW]),
        ((pgpe, sac), []),
        ((pgpe, sac, RANDOM), [HEAVY]),
        ((pgpe, dqn, sac, RANDOM), [SLOW, HEAVY, HEAVY]),
    ]:
        found = check(*agents, table=claims.table(UNTIMED))
        assert len(found) == len(parts)
        for claim, part in zip(found, parts, strict=True):
            assert part in claim["text"]
            assert f"among {len(parts)} claims" in claim["evidence"]
