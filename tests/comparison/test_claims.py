"""The claims: each compares what docs/measures-and-claims.md says."""

import re
from dataclasses import replace

import numpy as np
import pytest
from small_field import (
    COMMANDS,
    HIGH,
    LOW,
    METRONOME,
    MIDDLE,
    RANDOM,
    TORN,
    agent,
    check,
    having,
    one_verdict,
    the_claim,
)

from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.comparison import timing
from jumping_ant.comparison.claims.field import Field, out_of_luck
from jumping_ant.comparison.claims.statements import CLAIMS, STATEMENTS
from jumping_ant.training import curves

JUMPS, OPEN_LOOP, FLUID = "learns to jump", "does not look at the robot", "less fluidly than SAC."
STIFF, BETTER, TWICE = "make movements less fluid", "ends better", "much better"
ROBUST, STEPS, SPARSE = "is robust", "more control steps", "rewards are sparse"
DISCRETE, FIVE, HALF = "Discreteness costs", "Having only five", "Half the torque"
CONSTANT, CRITIC, LIGHTER = "A constant off the reward", "A second critic", "A lighter body"
LEVELS = {"kind": "levels", "levels": 2, "amplitude": 1.0, "hold": 1}


def test_every_statement_of_the_article_has_a_title_and_claims():
    text = (PROJECT_ROOT / "docs" / "measures-and-claims.md").read_text(encoding="utf-8")
    numbers = set(map(int, re.findall(r"^\| (\d\d?)[ab]? \|", text, re.M)))
    assert STATEMENTS.keys() == numbers
    tested = [row.statement for _, rows in (*CLAIMS, *timing.table({})) for row in rows]
    assert set(tested) == numbers | {None}


@pytest.mark.parametrize(
    ("flight", "apex", "verdict"),
    [
        (HIGH, HIGH, "supported"),
        (LOW, LOW, "refuted"),
        (HIGH, np.append(LOW[:4], HIGH[4:]), "inconclusive"),
        (LOW, HIGH, "inconclusive"),  # in the air for less time, but higher
    ],
)
def test_jumping_is_flight_and_height(flight, apex, verdict):
    dqn = having(agent("dqn", "dqn"), flight=flight, apex=apex)
    random = having(RANDOM, flight=MIDDLE, apex=MIDDLE)
    assert one_verdict(JUMPS, dqn, random) == verdict


def test_the_weaker_half_of_jumping_decides():
    half = np.append(LOW[:3], HIGH[3:])
    random = having(RANDOM, flight=MIDDLE, apex=MIDDLE)
    claim = the_claim(JUMPS, having(agent("dqn", "dqn"), flight=HIGH, apex=half), random)
    assert claim["p"] > 0.05
    assert claim["effect"]["value"] == pytest.approx(5 / 8)
    assert claim["plot"]["axis"] == "Apex of a jump [m]"


def test_random_commands_come_before_random_torques():
    typing = agent("typing", "random", actions=COMMANDS)
    assert "than typing" in the_claim(JUMPS, agent("dqn", "dqn"), RANDOM, typing)["text"]


def test_sceptics_ask_for_more_than_the_best_metronome_of_no_more_torque():
    dqn, sac = agent("dqn", "dqn", actions=COMMANDS), agent("sac", "sac")
    weak = agent("weak", "open_loop", LOW, amplitude=0.5)
    strong = agent("strong", "open_loop", HIGH, amplitude=1.0)
    claim = the_claim(OPEN_LOOP, dqn, weak, strong)
    assert (claim["agents"], claim["statement"]) == (["dqn", "weak"], None)
    assert the_claim(OPEN_LOOP, sac, weak, strong)["agents"] == ["sac", "strong"]
    assert not [claim for claim in check(dqn, strong) if OPEN_LOOP in claim["text"]]


def test_a_metronome_plays_on_the_learners_robot():
    strong = agent("strong", "open_loop", HIGH)
    unedited = agent("unedited", "open_loop", LOW, robot="unedited")
    plain = agent("sac", "sac", robot="unedited")
    assert Field([strong, unedited], 2).metronome(agent("sac", "sac")) is strong
    assert Field([strong, unedited], 2).metronome(plain) is unedited
    assert Field([strong], 2).metronome(plain) is None


def test_an_oscillator_is_another_open_loop_and_no_rival_in_evolution():
    blind = agent("blind", "oscillator", LOW)
    claims = check(agent("pgpe", "pgpe", HIGH), METRONOME, blind)
    assert [OPEN_LOOP in claim["text"] for claim in claims] == [True, True]
    weak = agent("dqn", "dqn", HIGH, actions=COMMANDS)
    assert not [claim for claim in check(weak, blind) if OPEN_LOOP in claim["text"]]


@pytest.mark.parametrize(
    ("part", "first", "second", "verdict"),
    [
        (FLUID, {"fluidity": -LOW}, {"fluidity": -HIGH}, "supported"),
        (FLUID, {"fluidity": -HIGH}, {"fluidity": -LOW}, "refuted"),
        (FLUID, {"fluidity": -LOW}, {"fluidity": -TORN}, "inconclusive"),
        (TWICE, {"return": HIGH}, {"return": MIDDLE}, "supported"),
        (TWICE, {"return": 1.5 * MIDDLE}, {"return": MIDDLE}, "refuted"),
        (TWICE, {"return": 2 * LOW}, {"return": TORN}, "inconclusive"),
    ],
)
def test_sac_beside_dqn(part, first, second, verdict):
    sac, dqn = having(agent("sac", "sac"), **first), having(agent("dqn", "dqn"), **second)
    claim = the_claim(part, sac, dqn)
    assert claim["verdict"] == verdict
    assert ("median ratio of two seeds" in claim["evidence"]) == (part == TWICE)


@pytest.mark.parametrize(
    ("part", "better", "worse"),
    [
        (DISCRETE, "published", "signed"),
        (FIVE, "signed", "rounded_full"),
        (HALF, "rounded_full", "rounded"),
    ],
)
@pytest.mark.parametrize(
    ("excess", "verdict"), [(50, "supported"), (-50, "refuted"), (0, "equivalent")]
)
@pytest.mark.parametrize("algorithm", ["sac", "pgpe"])
def test_what_costs_is_judged_on_the_same_seeds(algorithm, part, better, worse, excess, verdict):
    # The spread over seeds exceeds the difference: only pairs tell them apart.
    returns = {better: MIDDLE, worse: MIDDLE - excess}
    variants = {name: {"return": own, "fluidity": own} for name, own in returns.items()}
    variants.pop("published", None)
    assert one_verdict(part, having(agent(algorithm, algorithm), variants)) == verdict


def test_half_of_half_the_torque_is_no_question():
    weak = {"kind": "torques", "amplitude": 0.5, "hold": 3}
    own = {"return": MIDDLE, "fluidity": MIDDLE}
    versions = dict.fromkeys(("signed", "rounded_full", "rounded"), own)
    texts = [claim["text"] for claim in check(having(agent("sac", "sac", actions=weak), versions))]
    assert [DISCRETE in text or STIFF in text for text in texts] == [True, True]


def test_two_levels_are_judged_where_the_robot_moves():
    signed = -HIGH.copy()
    signed[0] = np.nan
    variants = {"signed": {"return": MIDDLE, "fluidity": signed}}
    sac = having(agent("sac", "sac"), variants, fluidity=-LOW)
    claim = the_claim(STIFF, sac)
    assert claim["p"] == 2 / 2**7
    assert "left out: 1 of SAC, two levels" in claim["evidence"]
    assert claim["plot"]["values"]["SAC, two levels"][0] is None
    assert claim["plot"]["paired"] is True


def test_where_nothing_moves_nothing_is_said_of_fluidity():
    sac = having(agent("sac", "sac"), fluidity=np.full(8, np.nan))
    claim = the_claim(FLUID, sac, agent("dqn", "dqn"))
    assert (claim["verdict"], claim["p"], claim["effect"]["value"]) == ("inconclusive", 1.0, None)
    assert "no seed has a value" in claim["evidence"]


@pytest.mark.parametrize(
    ("spread", "rivals_spread", "verdict"),
    [(0.01, 0.5, "supported"), (0.5, 0.01, "refuted"), (0.3, 0.3, "inconclusive")],
)
def test_robust_means_less_spread_relative_to_the_median(spread, rivals_spread, verdict):
    shape = np.array([-1.0, -0.9, -0.8, -0.7, 0.7, 0.8, 0.9, 1.0])
    # In absolute terms PGPE always spreads most: it returns the most.
    pgpe = agent("pgpe", "pgpe", 1e6 * (1 + spread * shape))
    claim = the_claim(ROBUST, pgpe, agent("sac", "sac", 100 * (1 + rivals_spread * shape)))
    assert claim["verdict"] == verdict
    assert f"worst seed {1e6 * (1 - spread):,.0f}" in claim["evidence"]


@pytest.mark.parametrize(("returns", "verdict"), [(MIDDLE, "supported"), (TORN, "inconclusive")])
@pytest.mark.parametrize(
    ("part", "pair", "settings"),
    [
        ("steadier than", "ppo a2c", {}),
        ("steadier than", "sac a2c", {}),
        (CONSTANT, "pgpe pgpe", {"decrease_rewards_by": 0.0}),
    ],
)
def test_an_agent_is_steadier_than_another(part, pair, settings, returns, verdict):
    first, second = pair.split()
    steady, other = agent("steady", first, returns), agent("other", second, TORN, **settings)
    assert one_verdict(part, steady, other) == verdict


def test_a_rival_that_never_learned_in_its_shorter_budget_settles_nothing():
    pgpe = agent("pgpe", "pgpe", HIGH, reached_at=900)
    stuck = agent("dqn", "dqn", LOW, budget=500)
    claim = the_claim(STEPS, pgpe, stuck, RANDOM)
    assert (claim["verdict"], claim["p"]) == ("inconclusive", 1.0)
    assert "0 of 8 seeds got there" in claim["evidence"]
    longer = agent("dqn", "dqn", LOW, budget=2000)
    assert one_verdict(STEPS, pgpe, longer, RANDOM) == "refuted"


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


@pytest.mark.parametrize(("seen_at", "p", "effect"), [(890, 1.0, 0.5), (850, 2 / 12870, 1.0)])
def test_efforts_between_the_same_evaluations_settle_nothing(seen_at, p, effect):
    """PGPE's lie between 855 and 900 control steps, DQN's between 500 and `seen_at`."""
    pgpe, dqn = (agent(name, name, HIGH, reached_at=900) for name in ("pgpe", "dqn"))
    steps = {"env_steps": np.array([500.0, seen_at, 1000.0])}
    early = {seed: curve | steps for seed, curve in dqn.curves.items()}
    claim = the_claim(STEPS, pgpe, replace(dqn, curves=early), RANDOM)
    assert (claim["p"], claim["effect"]["value"]) == (p, effect)


def test_random_policies_stay_below_what_counts_as_learning():
    generator = np.random.default_rng(0)
    returns = generator.gamma(2.0, 200.0, 1000)  # skewed, as theirs are
    threshold = out_of_luck(replace(RANDOM, episodes={"return": returns}), 5)
    assert threshold == pytest.approx(returns.mean() + 5 * returns.std() / np.sqrt(5))
    assert np.mean(generator.gamma(2.0, 200.0, (20_000, 5)).mean(axis=1) > threshold) < 0.001


@pytest.mark.parametrize(
    ("best_sample", "verdict"),  # the margin is 10
    [(MIDDLE + 9, "supported"), (MIDDLE + 11, "refuted"), (MIDDLE + 10, "inconclusive")],
)
def test_the_centre_is_that_of_the_final_search(best_sample, verdict):
    variants = {"final": {"return": MIDDLE}, "best_sample": {"return": best_sample}}
    assert one_verdict("its best policy", having(agent("pgpe", "pgpe"), variants)) == verdict


@pytest.mark.parametrize(
    ("names", "parts"),
    [
        ("random open_loop", []),
        ("random dqn", [JUMPS]),
        ("dqn open_loop", [OPEN_LOOP]),
        ("dqn sac", [FLUID, BETTER, TWICE]),
        ("pgpe random", []),
        ("pgpe sac", [ROBUST]),
        ("pgpe sac random", [ROBUST, STEPS]),
    ],
)
def test_claims_without_their_agents_are_left_out(names, parts):
    claims = check(*(agent(name, name) for name in names.split()))
    assert len(claims) == len(parts)
    for claim, part in zip(claims, parts, strict=True):
        assert part in claim["text"]


def test_agents_stand_for_their_algorithm_whatever_their_name():
    buttons, levers = agent("buttons", "dqn"), agent("levers", "dqn")
    texts = [claim["text"] for claim in check(agent("noise", "random"), buttons, levers)]
    assert [text.split(":")[0] for text in texts] == [
        "buttons learns to jump", "levers learns to jump"
    ]  # fmt: skip
    assert all("noise" in text for text in texts)


@pytest.mark.parametrize(
    ("returns", "verdict"), [(LOW, "supported"), (HIGH, "refuted"), (MIDDLE, "inconclusive")]
)
@pytest.mark.parametrize(
    ("part", "pair", "settings", "others"),
    [
        (OPEN_LOOP, "dqn open_loop", {}, {}),
        (OPEN_LOOP, "sac open_loop", {}, {}),
        (OPEN_LOOP, "pgpe open_loop", {}, {}),
        (BETTER, "sac dqn", {}, {}),
        (DISCRETE, "pgpe pgpe", {}, {"actions": LEVELS}),
        (FIVE, "pgpe pgpe", {"actions": COMMANDS | {"kind": "torques"}}, {"actions": COMMANDS}),
        (HALF, "dqn dqn", {"actions": COMMANDS | {"amplitude": 1.0}}, {"actions": COMMANDS}),
        (CRITIC, "td3 td3", {}, {"n_critics": 1}),
        (SPARSE, "pgpe sac", {}, {"sparse_rewards": True}),
        (SPARSE, "pgpe dqn", {}, {"sparse_rewards": True}),
        ("best evolutionary", "pgpe snes", {}, {}),
        ("best evolutionary", "pgpe cmaes", {}, {}),
    ],
)
def test_an_agent_returns_more_than_another(part, pair, settings, others, returns, verdict):
    one, other = pair.split()
    claim = the_claim(part, agent("one", one, **settings), agent("other", other, returns, **others))
    assert (claim["verdict"], claim["agents"]) == (verdict, ["one", "other"])


def test_a_robot_jumps_higher_than_the_unedited_one():
    plain = having(agent("plain", "sac", robot="unedited"), apex=LOW)
    assert one_verdict(LIGHTER, plain, having(agent("sac", "sac"), apex=HIGH)) == "supported"


def test_the_first_of_agents_that_differ_in_their_actions_stands_for_the_algorithm():
    slow = agent("slow", "dqn", actions=COMMANDS | {"hold": 5})
    first, second = agent("dqn", "dqn"), agent("same", "dqn")
    texts = [claim["text"] for claim in check(agent("sac", "sac"), first, second, slow)]
    assert [any(name in text for text in texts) for name in ("DQN", "same", "slow")] == [
        True, True, False
    ]  # fmt: skip


ALONE = [
    (CONSTANT, "pgpe", {"decrease_rewards_by": 0.0}),
    (DISCRETE, "pgpe", {"actions": LEVELS}),
    (HALF, "dqn", {"actions": COMMANDS | {"amplitude": 1.0}}),
    (CRITIC, "td3", {"n_critics": 1}),
    (SPARSE, "sac", {"sparse_rewards": True}),
    (SPARSE, "dqn", {"sparse_rewards": True}),
    (LIGHTER, "sac", {"robot": "unedited"}),
]


@pytest.mark.parametrize(("part", "algorithm", "settings"), ALONE)
def test_agents_that_serve_one_comparison_stand_for_nothing_else(part, algorithm, settings):
    others = [agent(name, name) for name in ("dqn", "sac", "pgpe", "ddpg", "td3", "a2c")]
    found = check(*others, RANDOM, METRONOME, agent("only", algorithm, **settings))
    (text,) = (claim["text"] for claim in found if "only" in claim["text"])
    assert part in text


@pytest.mark.parametrize(
    ("part", "algorithm", "settings"), [row for row in ALONE if row[0] != SPARSE]
)
def test_agents_that_differ_by_more_are_not_compared(part, algorithm, settings):
    more = {"tumbled_starts": 0.9} if algorithm in ("sac", "td3") else {"episode_steps": 7}
    other = agent("other", algorithm, **settings, **more)
    assert not any(part in claim["text"] for claim in check(agent("own", algorithm), other))


def test_no_agent_with_sparse_rewards_stands_for_its_algorithm():
    rest = [agent(name, name) for name in ("dqn", "sac", "pgpe", "ddpg", "td3", "a2c", "ppo")]
    sparse = [agent(f"sparse-{name}", name, sparse_rewards=True) for name in ("td3", "a2c", "ppo")]
    assert len(check(*rest, *sparse, RANDOM)) == len(check(*rest, RANDOM)) > 10


@pytest.mark.parametrize(
    ("reached_at", "verdict"), [(900, "supported"), (60, "refuted"), (100, "inconclusive")]
)
@pytest.mark.parametrize(
    ("part", "pair"),
    [
        ("more efficient than", "ppo a2c"),
        ("more efficient than", "sac a2c"),
        ("The more complex", "dqn ddpg"),
        ("The more complex", "ddpg td3"),
        (STEPS, "sac pgpe"),
        ("skips exploration", "bc sac"),
    ],
)
def test_effort_counts_until_something_is_learned(part, pair, reached_at, verdict):
    fast, slow = pair.split()
    slower = agent(slow, slow, HIGH, reached_at)
    faster = replace(agent(fast, fast, HIGH), demonstrator=slow if fast == "bc" else "")
    assert one_verdict(part, faster, slower, RANDOM) == verdict


def test_an_imitator_is_compared_with_nobody_else():
    parrot = replace(agent("parrot", "bc", HIGH), demonstrator="sac")
    (claim,) = check(parrot, agent("sac", "sac", HIGH), agent("wide", "sac", HIGH), RANDOM)
    assert "parrot needs fewer control steps than SAC" in claim["text"]
