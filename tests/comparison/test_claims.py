"""Claims as data: what each measure compares, and the rule that gives every verdict."""

import json
from dataclasses import replace

import numpy as np
import pytest
from small_field import HIGH, LEARNED, LOW, MIDDLE, TORN, agent, claim, having, judge, one_of
from small_project import COMPARE

from jumping_ant.comparison import claims
from jumping_ant.comparison.step_down import Adjusted
from jumping_ant.training import curves

SAC, DQN = agent("sac", "sac"), agent("dqn", "dqn")
SHAPE = np.array([-1.0, -0.9, -0.8, -0.7, 0.7, 0.8, 0.9, 1.0])
NARROW = np.linspace(500.0, 501.0, 8)


def test_an_entry_follows_its_contract():
    entry = one_of(
        claim(margin=10), having(SAC, **{"return": HIGH}), having(DQN, **{"return": LOW})
    )
    assert list(entry) == [
        *("text", "statement", "verdict", "evidence", "measure", "agents", "side", "value", "low"),
        *("high", "no_effect", "margin", "test", "p", "p_adjusted", "p_equivalence"),
        *("p_equivalence_adjusted", "plot"),
    ]
    assert (entry["verdict"], entry["agents"], entry["margin"]) == ("supported", ["sac", "dqn"], 10)
    assert entry["value"] == pytest.approx(np.median(np.subtract.outer(HIGH, LOW)))
    assert entry["low"] < entry["value"] < entry["high"]
    assert entry["p"] == entry["p_adjusted"] == pytest.approx(2 / 12870)
    assert entry["p_equivalence"] == pytest.approx(1.0)
    assert entry["plot"] == {
        "axis": "Return", "values": {"SAC": HIGH.tolist(), "DQN": LOW.tolist()}
    }  # fmt: skip
    assert entry["evidence"].startswith("Return: SAC 3,150 [")
    assert "ratio 10" in entry["evidence"]
    assert entry["evidence"].endswith("margin 10: p = 1, 1 adjusted).")
    json.dumps(entry, allow_nan=False)


@pytest.mark.parametrize("side", ["more", "less"])
@pytest.mark.parametrize(
    ("first", "verdict"), [(HIGH, "supported"), (LOW, "refuted"), (TORN, "inconclusive")]
)
@pytest.mark.parametrize("measure", ["return", "fluidity", "retention_world", "speed_up"])
def test_a_quantity_of_one_agent_exceeds_that_of_another(measure, first, side, verdict):
    middle = having(DQN, **{measure: np.linspace(310, 320, 8) if first is TORN else MIDDLE})
    entry = one_of(claim(measure, side=side), having(SAC, **{measure: first}), middle)
    turned = {"supported": "refuted", "refuted": "supported"}
    assert entry["verdict"] == (verdict if side == "more" else turned.get(verdict, verdict))


def test_versions_of_one_agent_are_judged_on_the_same_seeds():
    # The spread over seeds exceeds the difference: only pairs tell them apart.
    versions = {"final": {"return": MIDDLE}, "best_sample": {"return": MIDDLE - 5}}
    pgpe = having(agent("pgpe", "pgpe"), versions)
    entry = one_of(claim(agent="pgpe/final", against="pgpe/best_sample"), pgpe)
    assert (entry["verdict"], entry["test"]) == ("supported", "sign-flip test")
    assert entry["plot"]["values"].keys() == {"PGPE, final", "PGPE, best sample"}
    assert entry["plot"]["paired"] is True
    assert one_of(claim(agent="pgpe/final", against="pgpe"), pgpe)["verdict"] == "inconclusive"


@pytest.mark.parametrize(
    ("flight", "apex", "verdict"),
    [
        (HIGH, HIGH, "supported"),
        (LOW, LOW, "refuted"),
        (HIGH, np.append(LOW[:4], HIGH[4:]), "inconclusive"),
        (LOW, HIGH, "inconclusive"),  # in the air for less time, but higher
    ],
)
def test_of_several_measures_the_weakest_decides(flight, apex, verdict):
    one = having(SAC, flight=flight, apex=apex)
    other = having(DQN, flight=MIDDLE, apex=MIDDLE)
    entry = one_of(claim(["flight", "apex"]), one, other)
    assert entry["verdict"] == verdict
    assert "; and Apex of a jump [m]: " in entry["evidence"]


def test_seeds_without_a_value_are_left_out_and_counted():
    gaps = np.where(np.arange(8) < 2, np.nan, HIGH)
    entry = one_of(claim("fluidity"), having(SAC, fluidity=gaps), having(DQN, fluidity=LOW))
    assert entry["p"] == pytest.approx(2 / 3003)  # of 14 seeds 6
    assert "(2 of 8 seeds without a value)" in entry["evidence"]
    assert entry["plot"]["values"]["SAC"][0] is None
    nothing = having(SAC, fluidity=np.full(8, np.nan))
    entry = one_of(claim("fluidity", margin=1), nothing, DQN)
    assert (entry["verdict"], entry["p"], entry["value"]) == ("inconclusive", 1.0, None)
    assert "no seed has a value" in entry["evidence"]


@pytest.mark.parametrize(
    ("spread", "rivals", "verdict"),
    [(0.01, 0.5, "supported"), (0.5, 0.01, "refuted"), (0.3, 0.3, "inconclusive")],
)
def test_spread_is_relative_to_the_median(spread, rivals, verdict):
    one = having(SAC, **{"return": 1e6 * (1 + spread * SHAPE)})
    entry = one_of(
        claim("spread", side="less", margin=0.001),
        one,
        having(DQN, **{"return": 100 * (1 + rivals * SHAPE)}),
    )
    assert entry["verdict"] == verdict
    assert f"worst seed {1e6 * (1 - spread):,.0f}" in entry["evidence"]


@pytest.mark.parametrize(
    ("reached_at", "verdict"), [(900, "supported"), (60, "refuted"), (100, "inconclusive")]
)
@pytest.mark.parametrize("measure", ["steps_to_learn", "seconds_to_learn"])
def test_effort_counts_until_something_is_learned(measure, reached_at, verdict):
    slow = agent("sac", "sac", HIGH, reached_at)
    entry = one_of(claim(measure), slow, agent("dqn", "dqn", HIGH))
    assert (entry["verdict"], entry["no_effect"]) == (verdict, 1.0)
    assert entry["value"] == pytest.approx(reached_at / 100, rel=0.01)


@pytest.mark.parametrize(
    ("reached_at", "verdict"), [(110, "equivalent"), (140, "supported"), (60, "refuted")]
)
def test_a_margin_of_efforts_is_a_ratio(reached_at, verdict):
    slow = agent("sac", "sac", HIGH, reached_at)
    entry = one_of(claim("seconds_to_learn", margin=1.25), slow, agent("dqn", "dqn", HIGH))
    assert entry["verdict"] == verdict


def test_a_rival_that_never_learned_in_its_shorter_budget_settles_nothing():
    late = agent("sac", "sac", HIGH, reached_at=900)
    entry = one_of(claim("steps_to_learn"), late, agent("dqn", "dqn", LOW, budget=500))
    assert (entry["verdict"], entry["p"]) == ("inconclusive", 1.0)
    assert "0 of 8 seeds got there" in entry["evidence"]
    assert entry["plot"]["reached"]["DQN"] == [False] * 8
    longer = agent("dqn", "dqn", LOW, budget=2000)
    assert one_of(claim("steps_to_learn"), late, longer)["verdict"] == "refuted"


@pytest.mark.parametrize(("seen_at", "p"), [(890, 1.0), (850, 2 / 12870)])
def test_efforts_between_the_same_evaluations_settle_nothing(seen_at, p):
    """Those of one lie between 855 and 900 control steps, of the other between 500 and these."""
    one, other = (agent(name, name, HIGH, reached_at=900) for name in ("sac", "dqn"))
    steps = {"env_steps": np.array([500.0, seen_at, 1000.0])}
    early = {seed: curve | steps for seed, curve in other.curves.items()}
    assert one_of(claim("steps_to_learn"), one, replace(other, curves=early))["p"] == pytest.approx(
        p
    )


@pytest.mark.parametrize(
    ("threshold", "bounds"),
    [(5.0, (30, 40)), (8.0, (40, 50)), (-1.0, (0, 10)), (9.0, (50, np.inf))],
)
def test_a_return_counts_where_it_lasts(threshold, bounds):
    luck = {
        "env_steps": np.array([10.0, 20.0, 30.0, 40.0, 50.0]),
        "evaluation_return_mean": np.array([9.0, np.nan, 0.0, 8.0, 9.0]),
    }
    assert curves.onset(luck, threshold, "env_steps") == bounds


def test_equal_budgets_are_those_of_the_smaller():
    """After 200 of 1,000 control steps the one returns a half, the other all that it ever does."""
    slow = agent("sac", "sac", HIGH, reached_at=400, budget=1000)
    quick = agent("dqn", "dqn", MIDDLE, reached_at=100, budget=390)
    entry = one_of(claim("return_at_equal_steps"), slow, quick)
    at_390 = np.interp(390, [380, 400], [0, 1]) * HIGH
    assert entry["plot"]["values"] == {"SAC": pytest.approx(at_390), "DQN": MIDDLE.tolist()}
    brief = agent("dqn", "dqn", MIDDLE, reached_at=100, budget=200)
    assert one_of(claim("return_at_equal_seconds"), slow, brief)["value"] is None


def test_who_learned_and_what_those_return_are_two_questions():
    some = np.where(np.arange(8) < 3, 0.0, HIGH)
    one, other = agent("sac", "sac", some), agent("dqn", "dqn", MIDDLE)
    entry = one_of(claim("learned", side="less"), one, other)
    assert entry["plot"]["values"] == {"SAC": [0.0] * 3 + [1.0] * 5, "DQN": [1.0] * 8}
    assert (entry["value"], entry["p"]) == (-3 / 8, pytest.approx(2 * 56 / 560))
    assert "SAC 5 of 8, DQN 8 of 8; difference -0.375 [-0.694, 0.0274]" in entry["evidence"]
    entry = one_of(claim("return_of_learned"), one, other)
    assert (entry["verdict"], entry["plot"]["values"]["SAC"][:3]) == ("supported", [None] * 3)


def test_random_policies_stay_below_what_counts_as_learned():
    generator = np.random.default_rng(0)
    returns = generator.gamma(2.0, 200.0, 1000)  # skewed, as theirs are
    random = replace(agent("random", "random"), episodes={"return": returns})
    threshold = claims.out_of_luck([random, SAC], 5)
    assert threshold == pytest.approx(returns.mean() + 5 * returns.std() / np.sqrt(5))
    assert np.mean(generator.gamma(2.0, 200.0, (20_000, 5)).mean(axis=1) > threshold) < 0.001
    assert claims.out_of_luck([SAC], 5) is None


@pytest.mark.parametrize(
    ("asked", "reason"),
    [
        (claim(against="ppo"), "no agent ppo in this run"),
        (claim(against="dqn/best_sample"), "no version best_sample of dqn in this run"),
        (claim("retention_senses"), "no retention_senses of SAC"),
    ],
)
def test_what_this_run_lacks_is_not_asked(asked, reason):
    judged = judge([asked, claim()], SAC, DQN)
    assert judged["not_asked"] == [{"text": "One is more.", "reason": reason}]
    assert len(judged["claims"]) == 1


def test_without_a_random_agent_nobody_knows_what_was_learned():
    agents = {"sac": SAC, "dqn": DQN}
    (left_out,) = claims.judge([claim("steps_to_learn")], agents, COMPARE)["not_asked"]
    assert left_out["reason"].startswith("no random agent")


def test_claims_on_seconds_are_apart():
    asked = [claim(), claim("speed_up"), claim("seconds_per_step"), claim("steps_to_learn")]
    assert claims.on_seconds(asked) == asked[1:3]
    assert claims.on_seconds(asked, is_so=False) == [asked[0], asked[3]]


@pytest.mark.parametrize("num_seeds", [1, 2, 3])
def test_few_seeds_decide_nothing(num_seeds):
    own = {"final": {"return": LOW[:num_seeds]}}
    one = having(agent("sac", "sac", HIGH[:num_seeds]), own)
    other = having(agent("dqn", "dqn", LOW[:num_seeds]))
    asked = [claim(), claim(against="sac/final"), claim("spread"), claim("steps_to_learn")]
    found = judge(asked, one, other)["claims"]
    assert {entry["verdict"] for entry in found} == {"inconclusive"}
    assert found[0]["low"] is None
    assert "too few seeds for an interval" in found[0]["evidence"]
    json.dumps(found, allow_nan=False)


def test_agents_that_differ_by_little_are_equivalent_even_if_surely():
    same, small = (
        one_of(claim(margin=10), having(SAC, **{"return": own}), having(DQN, **{"return": NARROW}))
        for own in (NARROW, NARROW + 3)
    )
    assert (same["verdict"], same["p"]) == ("equivalent", pytest.approx(1.0))
    assert same["p_equivalence"] == pytest.approx(1 / 12870)
    assert (small["verdict"], small["p"] < 0.001) == ("equivalent", True)


def test_p_values_are_adjusted_together():
    versions = {"final": {"return": MIDDLE}, "best_sample": {"return": MIDDLE - 50}}
    pgpe = having(agent("pgpe", "pgpe"), versions)
    asked = claim(agent="pgpe/final", against="pgpe/best_sample")
    assert one_of(asked, pgpe)["verdict"] == "supported"
    # Eight open questions more, and what eight pairs can show is not rare enough any more.
    entry = judge([asked, *[claim()] * 8], pgpe, SAC, DQN)["claims"][0]
    assert entry["p"] == 2 / 256
    assert (entry["verdict"], entry["p_adjusted"] > 0.05) == ("inconclusive", True)


@pytest.mark.parametrize(
    ("side", "difference", "equivalence", "verdict"),
    [
        (0.4, 0.04, None, "supported"),
        (-0.4, 0.04, 1.0, "refuted"),
        (0.4, 0.041, None, "inconclusive"),
        (-0.4, 0.041, 0.041, "inconclusive"),
        (0.4, 0.041, 0.04, "equivalent"),
        (-0.4, 0.04, 0.04, "equivalent"),
        (0.0, 0.0, None, "inconclusive"),
    ],
)
def test_the_rule_of_verdicts(side, difference, equivalence, verdict):
    assert claims.verdict(side, Adjusted(difference, equivalence)) == verdict


def test_what_was_learned_is_above_random_returns():
    assert LOW.max() < LEARNED < MIDDLE.min()
