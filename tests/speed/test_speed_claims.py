"""The claims that rest on seconds: each compares what docs/claims.md says."""

import numpy as np
import pytest
from small_field import HEAVY, HIGH, PARALLEL, RANDOM, SLOW, agent, check, one_verdict, the_claim

from jumping_ant.speed import claims

UNTIMED = dict.fromkeys(("pgpe", "sac", "dqn"), {})


@pytest.mark.parametrize(
    ("budget", "verdict"), [(9000, "supported"), (200, "refuted"), (1000, "inconclusive")]
)
def test_training_time_is_that_in_all(budget, verdict):
    agents = agent("sac", "sac", budget=budget), agent("dqn", "dqn", budget=1000)
    assert one_verdict(SLOW, *agents, table=claims.table(UNTIMED)) == verdict


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
    assert (claim["verdict"], claim["seeds_needed"]) == ("inconclusive", None)


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
