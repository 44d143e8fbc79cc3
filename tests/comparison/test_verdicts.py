"""The rule that gives every verdict, and what is said with it."""

import json

import pytest
from small_field import (
    HIGH,
    LIGHTER,
    LOW,
    METRONOME,
    MIDDLE,
    OPEN_LOOP,
    ROUNDED,
    TORN,
    agent,
    check,
    having,
    one_verdict,
    the_claim,
)

from jumping_ant.comparison.claims import verdicts


@pytest.mark.parametrize("num_seeds", [1, 2, 3])
def test_few_seeds_are_inconclusive_and_say_so(num_seeds):
    variants = {"rounded": {"return": LOW[:num_seeds], "fluidity": LOW[:num_seeds]}}
    agents = [
        having(agent(name, name, HIGH[:num_seeds]), variants)
        for name in ("random", "open_loop", "dqn", "sac", "pgpe")
    ]
    found = check(*agents)
    assert {claim["verdict"] for claim in found} == {"inconclusive"}
    assert all("too few seeds for a verdict" in claim["evidence"] for claim in found)
    json.dumps(found, allow_nan=False)


def test_entries_follow_their_contract():
    (claim,) = check(agent("dqn", "dqn", HIGH), METRONOME)
    assert list(claim) == [
        "text", "statement", "verdict", "evidence", "effect", "test", "p", "p_holm", "plot",
    ]  # fmt: skip
    assert claim["effect"] == {
        "name": "probability that a seed of DQN exceeds one of metronome",
        "value": 1.0, "low": 1.0, "high": 1.0,
    }  # fmt: skip
    assert claim["plot"] == {
        "axis": "Return", "values": {"DQN": HIGH.tolist(), "metronome": LOW.tolist()}
    }  # fmt: skip
    assert "DQN 3,150 [" in claim["evidence"]
    assert "exact rank test, 8 seeds: p = 0.00016, 0.00016 among 1 claims" in claim["evidence"]
    json.dumps(claim, allow_nan=False)


def test_p_values_are_corrected_together():
    variants = {"rounded": {"return": MIDDLE - 50, "fluidity": MIDDLE}}
    sac = having(agent("sac", "sac"), variants)
    assert one_verdict(ROUNDED, sac) == "supported"
    # Eight open questions more, and what eight pairs can show is not rare enough any more.
    others = [agent(f"dqn-{i}", "dqn", TORN) for i in range(4)]
    claim = the_claim(ROUNDED, sac, METRONOME, *others)
    assert claim["p"] == 2 / 256
    assert (claim["verdict"], claim["p_holm"] > 0.05) == ("inconclusive", True)
    assert claim["seeds_needed"] > 8


def test_open_claims_say_how_many_seeds_they_need():
    claim = the_claim(OPEN_LOOP, agent("dqn", "dqn", TORN), METRONOME)
    assert claim["verdict"] == "inconclusive"
    assert claim["seeds_needed"] is None or claim["seeds_needed"] > 8
    nothing = the_claim(OPEN_LOOP, agent("dqn", "dqn", LOW), METRONOME)
    assert nothing["seeds_needed"] is None
    assert "more than 1,000 seeds" in nothing["evidence"]


@pytest.mark.parametrize(
    ("side", "p_holm", "verdict"),
    [
        (0.4, 0.05, "supported"),
        (-0.4, 0.05, "refuted"),
        (0.4, 0.051, "inconclusive"),
        (-0.4, 0.051, "inconclusive"),
        (0.0, 0.0, "inconclusive"),
    ],
)
def test_the_rule_of_verdicts(side, p_holm, verdict):
    assert verdicts.verdict(side, p_holm, 0.95) == verdict


def test_seeds_that_all_agree_are_a_constant():
    same = agent("same", "open_loop", [600.0] * 8)
    above = the_claim(OPEN_LOOP, agent("dqn", "dqn", HIGH), same)
    assert (above["verdict"], above["p"]) == ("supported", 2 / 2**8)
    assert "all seeds of same are the same policy" in above["evidence"]
    below = agent("dqn", "dqn", [*LOW[:7], 2000.0])
    assert one_verdict(OPEN_LOOP, below, same) == "inconclusive"


def test_two_agents_without_spread_are_not_tested():
    edited = having(agent("edited", "open_loop"), apex=[2.0] * 8)
    plain = having(agent("plain", "open_loop", robot="unedited"), apex=[1.0] * 8)
    claim = the_claim(LIGHTER, edited, plain)
    assert (claim["verdict"], claim["p"], claim["seeds_needed"]) == ("inconclusive", 1.0, None)
