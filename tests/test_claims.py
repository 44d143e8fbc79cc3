from dataclasses import replace

import numpy as np
import pytest
from small_project import COMPARE

from jumping_ant import claims
from jumping_ant.comparison import AgentResults, SeedCurve
from jumping_ant.statistics import Estimate

LOW, MIDDLE, HIGH = [300, 310, 320, 330], [700, 720, 740, 760], [3000, 3100, 3200, 3300]
TORN = [100, 305, 325, 900]  # on both sides of LOW
JUMPS, FLUID, SLOW = "jumping pays", "less fluidly", "training time"
PARALLEL = "parallelises"
BETTER, ROBUST, HEAVY = "much better", "is robust", "is computationally heavy"


def agent(name, algorithm, returns, smoothness=0.5, ms_per_step=1.0, reached_at=100, budget=1000):
    """Return an agent whose seeds all reach their return at `reached_at`, from 0 before."""
    steps = np.array([50.0, reached_at, budget])
    curves = {
        seed: SeedCurve(
            env_steps=steps,
            seconds=steps * ms_per_step * (1 + 0.01 * seed) / 1000,
            evaluation_return=np.where(steps >= reached_at, float(value), 0.0),
        )
        for seed, value in enumerate(returns)
    }
    quantities = {
        "return": np.array(returns, dtype=float),
        "smoothness": smoothness + 0.01 * np.arange(len(returns)),
    }
    return AgentResults(name, algorithm, quantities, curves)


def check(*agents):
    """Return the verdicts by the claim's text, and the claims."""
    found = claims.check({one.name: one for one in agents}, COMPARE)
    return {claim["text"]: claim["verdict"] for claim in found}, found


def one_verdict(part, *agents):
    """Return the verdict on the only claim whose text has a part."""
    matching = [verdict for text, verdict in check(*agents)[0].items() if part in text]
    assert len(matching) == 1
    return matching[0]


@pytest.mark.parametrize(
    ("returns", "verdict"),
    [(MIDDLE, "supported"), ([1, 2, 3, 4], "refuted"), (TORN, "inconclusive")],
)
def test_jumping_pays_if_dqn_beats_random(returns, verdict):
    agents = agent("dqn", "dqn", returns), agent("random", "random", LOW)
    assert one_verdict(JUMPS, *agents) == verdict


@pytest.mark.parametrize(
    ("smoothness", "verdict"), [(1.0, "supported"), (0.2, "refuted"), (0.5, "inconclusive")]
)
def test_fluidity_is_judged_by_smoothness(smoothness, verdict):
    agents = agent("dqn", "dqn", LOW, smoothness=smoothness), agent("sac", "sac", LOW)
    assert one_verdict(FLUID, *agents) == verdict


@pytest.mark.parametrize(
    ("ms_per_step", "verdict"), [(20.0, "supported"), (0.1, "refuted"), (1.0, "inconclusive")]
)
def test_training_time_is_compared_per_step(ms_per_step, verdict):
    # DQN trains for ten times the steps: its time in all is no argument.
    sac = agent("sac", "sac", LOW, ms_per_step=ms_per_step, budget=1000)
    assert one_verdict(SLOW, sac, agent("dqn", "dqn", LOW, budget=10000)) == verdict


@pytest.mark.parametrize(
    ("returns", "verdict"),
    [(HIGH, "supported"), ([2 * value for value in TORN], "inconclusive"), (MIDDLE, "refuted")],
)
def test_much_better_means_twice_the_return(returns, verdict):
    rival = LOW if verdict == "inconclusive" else [600, 610, 620, 630]
    agents = agent("sac", "sac", returns), agent("dqn", "dqn", rival)
    assert one_verdict(BETTER, *agents) == verdict


@pytest.mark.parametrize(
    ("spread", "rivals_spread", "verdict"),
    [(0.01, 0.5, "supported"), (0.5, 0.01, "refuted"), (0.3, 0.3, "inconclusive")],
)
def test_robust_means_less_spread_relative_to_the_mean(spread, rivals_spread, verdict):
    shape = np.array([-1.0, -0.8, 0.8, 1.0])
    # In absolute terms PGPE always spreads most: it returns the most.
    pgpe = agent("pgpe", "pgpe", 1e6 * (1 + spread * shape))
    rivals = [agent(name, name, 100 * (1 + rivals_spread * shape)) for name in ("sac", "dqn")]
    assert one_verdict(ROBUST, pgpe, *rivals) == verdict


@pytest.mark.parametrize(
    ("reached_at", "verdict"), [(900, "supported"), (60, "refuted"), (100, "inconclusive")]
)
def test_heavy_means_more_steps_until_something_is_learned(reached_at, verdict):
    pgpe = agent("pgpe", "pgpe", HIGH, reached_at=reached_at)
    rivals = agent("sac", "sac", HIGH), agent("dqn", "dqn", MIDDLE)
    assert one_verdict(HEAVY, pgpe, *rivals, agent("random", "random", LOW)) == verdict


def test_a_rival_that_never_learned_in_its_shorter_budget_settles_nothing():
    pgpe = agent("pgpe", "pgpe", HIGH, reached_at=900)
    random = agent("random", "random", LOW)
    stuck = agent("dqn", "dqn", LOW, budget=500)
    assert one_verdict(HEAVY, pgpe, stuck, random) == "inconclusive"
    longer = agent("dqn", "dqn", LOW, budget=2000)
    assert one_verdict(HEAVY, pgpe, longer, random) == "refuted"


def test_where_nothing_returns_anything_nothing_is_said_of_learning():
    nothing = [0.0, 0.0, 0.0, 0.0]
    pgpe, random = agent("pgpe", "pgpe", nothing), agent("random", "random", nothing)
    rival = agent("dqn", "dqn", nothing, budget=500)
    assert one_verdict(HEAVY, pgpe, rival, random) == "inconclusive"
    assert one_verdict(ROBUST, pgpe, agent("sac", "sac", TORN), random) == "inconclusive"


def test_claims_on_missing_algorithms_are_left_out():
    dqn, random = agent("dqn", "dqn", MIDDLE), agent("random", "random", LOW)
    sac, pgpe = agent("sac", "sac", HIGH), agent("pgpe", "pgpe", HIGH)
    assert len(check(random, dqn, sac, pgpe)[1]) == 6
    for agents, parts in [
        ((random,), []),
        ((random, dqn), [JUMPS]),
        ((dqn, sac), [FLUID, SLOW, BETTER]),
        ((pgpe, random), []),
        ((pgpe, sac), [ROBUST]),
        ((pgpe, sac, random), [ROBUST, HEAVY]),
    ]:
        texts = list(check(*agents)[0])
        assert len(texts) == len(parts)
        assert all(part in text for part, text in zip(parts, texts, strict=True))


def test_agents_stand_for_their_algorithm_whatever_their_name():
    verdicts, _ = check(
        agent("noise", "random", LOW),
        agent("buttons", "dqn", MIDDLE),
        agent("levers", "dqn", [1, 2, 3, 4]),
    )
    assert verdicts == {
        "buttons learns that jumping pays: it returns more than noise.": "supported",
        "levers learns that jumping pays: it returns more than noise.": "refuted",
    }


@pytest.mark.parametrize("num_seeds", [1, 2, 3])
def test_few_seeds_are_inconclusive_and_say_so(num_seeds):
    agents = [
        agent(name, name, returns[:num_seeds])
        for name, returns in {"random": LOW, "dqn": MIDDLE, "sac": HIGH, "pgpe": HIGH}.items()
    ]
    verdicts, found = check(*agents)
    assert set(verdicts.values()) == {"inconclusive"}
    assert all("too few seeds for a verdict" in claim["evidence"] for claim in found)


def test_evidence_gives_the_numbers():
    (claim,) = check(agent("dqn", "dqn", MIDDLE), agent("random", "random", LOW))[1]
    assert list(claim) == ["text", "verdict", "evidence"]
    assert "DQN 730 [" in claim["evidence"]
    assert "random 315 [" in claim["evidence"]
    assert "probability 1 [1, 1]" in claim["evidence"]
    assert "4 seeds each, 95% intervals" in claim["evidence"]


@pytest.mark.parametrize(
    ("low", "high", "num_seeds", "verdict"),
    [
        (0.6, 0.9, 4, "supported"),
        (0.1, 0.4, 4, "refuted"),
        (0.4, 0.6, 4, "inconclusive"),
        (0.5, 0.9, 4, "inconclusive"),  # no effect is still inside
        (0.1, 0.5, 4, "inconclusive"),
        (0.6, 0.9, 3, "inconclusive"),
    ],
)
def test_the_rule_of_verdicts(low, high, num_seeds, verdict):
    effect = Estimate(np.array((low + high) / 2), np.array(low), np.array(high))
    assert claims.verdict(effect, 0.5, num_seeds, 0.95) == verdict


@pytest.mark.parametrize(
    ("speed_up", "verdict"), [(1.9, "supported"), (0.9, "refuted"), (1.0, "inconclusive")]
)
def test_a_population_parallelises_if_threads_bring_half_of_the_ideal(speed_up, verdict):
    one = np.array([2.0, 2.02, 1.98, 2.01])
    pgpe = replace(
        agent("pgpe", "pgpe", HIGH),
        generation_seconds={1: one, 2: one / (speed_up + np.array([-0.02, 0.0, 0.0, 0.02]))},
    )
    assert one_verdict(PARALLEL, pgpe) == verdict


def test_one_core_says_nothing_of_parallel_work():
    pgpe = replace(agent("pgpe", "pgpe", HIGH), generation_seconds={1: np.ones(4)})
    _, found = check(pgpe)
    assert found[0]["verdict"] == "inconclusive"
    assert "this machine has one core" in found[0]["evidence"]
