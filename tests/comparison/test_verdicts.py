"""The rule that gives every verdict, and what is said with it."""

import json

import numpy as np
import pytest
from small_field import HIGH, LOW, METRONOME, MIDDLE, TORN, agent, check, having, the_claim

from jumping_ant.comparison.claims import verdicts
from jumping_ant.comparison.step_down import Adjusted


@pytest.mark.parametrize("num_seeds", [1, 2, 3])
def test_few_seeds_decide_nothing(num_seeds):
    own = {"return": LOW[:num_seeds], "fluidity": LOW[:num_seeds]}
    variants = dict.fromkeys(("signed", "rounded_full", "rounded", "final", "best_sample"), own)
    agents = [
        having(agent(name, name, HIGH[:num_seeds]), variants)
        for name in ("random", "open_loop", "dqn", "sac", "pgpe")
    ]
    found = check(*agents)
    assert {claim["verdict"] for claim in found} == {"inconclusive"}
    json.dumps(found, allow_nan=False)


def test_entries_follow_their_contract():
    (claim,) = check(agent("dqn", "dqn", HIGH), METRONOME)
    assert list(claim) == [
        "text", "statement", "agents", "verdict", "evidence", "effect", "no_effect",
        "test", "p", "p_adjusted", "margin", "p_equivalence", "p_equivalence_adjusted", "plot",
    ]  # fmt: skip
    assert claim["agents"] == ["dqn", "metronome"]
    assert claim["effect"] == {
        "name": "probability that a seed of DQN exceeds one of metronome",
        "value": 1.0, "low": 1.0, "high": 1.0,
    }  # fmt: skip
    assert claim["plot"] == {
        "axis": "Return", "values": {"DQN": HIGH.tolist(), "metronome": LOW.tolist()}
    }  # fmt: skip
    assert claim["margin"] == {"low": -10, "high": 10}
    assert claim["p_equivalence"] == claim["p_equivalence_adjusted"] == 1.0
    assert "DQN 3,150 [" in claim["evidence"]
    assert "median difference of two seeds 2,8" in claim["evidence"]
    assert "rank test, 8 seeds: p = 0.00016, 0.00016 among 1 claims; " in claim["evidence"]
    assert "margin -10 to 10: p = 1, 1)." in claim["evidence"]
    json.dumps(claim, allow_nan=False)


def test_claims_without_a_margin_have_no_second_p_value():
    dqn = agent("dqn", "dqn", LOW)
    claim = the_claim("ends better", agent("sac", "sac", HIGH), dqn)
    keys = ("margin", "p_equivalence", "p_equivalence_adjusted")
    assert [claim[key] for key in keys] == [None] * 3
    assert "margin" not in claim["evidence"]


def test_agents_that_differ_by_little_are_equivalent():
    same = np.linspace(500.0, 501.0, 8)
    claim = the_claim("does not look", agent("dqn", "dqn", same), agent("alike", "open_loop", same))
    assert (claim["verdict"], claim["p"]) == ("equivalent", 1.0)
    assert claim["p_equivalence"] == pytest.approx(1 / 12870)


def test_a_small_difference_that_is_sure_is_told_as_small():
    small = np.linspace(500.0, 501.0, 8)
    dqn = agent("dqn", "dqn", small + 3)
    claim = the_claim("does not look", dqn, agent("alike", "open_loop", small))
    assert claim["verdict"] == "supported"
    assert claim["evidence"].endswith("the difference is below practical size).")


def test_what_is_not_worse_says_by_how_much():
    variants = {"final": {"return": MIDDLE}, "best_sample": {"return": MIDDLE}}
    claim = the_claim("its best policy", having(agent("pgpe", "pgpe"), variants))
    assert "mean difference of the same seeds 0 [0, 0], tested against -10" in claim["evidence"]
    assert (claim["verdict"], claim["p"], claim["no_effect"]) == ("supported", 2 / 256, -10)


def test_p_values_are_adjusted_together():
    variants = {"final": {"return": MIDDLE}, "best_sample": {"return": MIDDLE - 50}}
    pgpe = having(agent("pgpe", "pgpe"), variants)
    assert the_claim("its best policy", pgpe)["verdict"] == "supported"
    # Eight open questions more, and what eight pairs can show is not rare enough any more.
    others = [agent(f"dqn-{i}", "dqn", TORN) for i in range(8)]
    claim = the_claim("its best policy", pgpe, METRONOME, *others)
    assert claim["p"] == 2 / 256
    assert (claim["verdict"], claim["p_adjusted"] > 0.05) == ("inconclusive", True)


@pytest.mark.parametrize(
    ("side", "difference", "equivalence", "verdict"),
    [
        (0.4, 0.04, None, "supported"),
        (-0.4, 0.04, 1.0, "refuted"),
        (0.4, 0.041, None, "inconclusive"),
        (-0.4, 0.041, 0.041, "inconclusive"),
        (0.4, 0.041, 0.04, "equivalent"),
        (-0.4, 0.04, 0.04, "refuted"),
        (0.0, 0.0, None, "inconclusive"),
    ],
)
def test_the_rule_of_verdicts(side, difference, equivalence, verdict):
    adjusted = Adjusted(difference, equivalence)
    assert verdicts.verdict(side, adjusted) == verdict
