"""The claims: each compares what docs/claims.md says."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from small_field import (
    BETTER,
    CENTRE,
    CONSTANT,
    FLUID,
    HEAVY,
    HIGH,
    JUMPS,
    LIGHTER,
    LOW,
    METRONOME,
    MIDDLE,
    OPEN_LOOP,
    PARALLEL,
    RANDOM,
    ROBUST,
    ROUNDED,
    SLOW,
    STIFF,
    TORN,
    agent,
    check,
    having,
    one_verdict,
    the_claim,
)

from jumping_ant.judging.claims.field import lacks_constant, out_of_luck, robot_of
from jumping_ant.params.blocks import CommandParams
from jumping_ant.training import curves


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
    both = the_claim(JUMPS, having(agent("dqn", "dqn"), flight=HIGH, apex=half), random)
    weak = the_claim(JUMPS, having(agent("dqn", "dqn"), flight=half, apex=half), random)
    assert both["p"] == weak["p"] > 0.05
    assert both["effect"]["value"] == pytest.approx(5 / 8)
    assert both["plot"]["axis"] == "Apex of a jump [m]"


def test_random_commands_come_before_random_torques():
    torques = agent("noise", "random", actions=SimpleNamespace(kind="torques"))
    commands = agent("typing", "random", actions=SimpleNamespace(kind="commands"))
    claim = the_claim(JUMPS, agent("dqn", "dqn"), torques, commands)
    assert "than typing" in claim["text"]


@pytest.mark.parametrize(
    ("returns", "verdict"), [(HIGH, "supported"), (LOW / 9, "refuted"), (TORN, "inconclusive")]
)
@pytest.mark.parametrize("algorithm", ["dqn", "sac", "pgpe"])
def test_sceptics_ask_for_more_than_open_loop(algorithm, returns, verdict):
    learner, worse = agent(algorithm, algorithm, returns), agent("worse", "open_loop", LOW / 10)
    claim = the_claim(OPEN_LOOP, learner, worse, METRONOME)
    assert (claim["verdict"], claim["statement"]) == (verdict, None)
    assert "more than metronome" in claim["text"]  # the better one


def test_a_metronome_is_no_stronger_than_the_learner():
    commands = CommandParams(kind="commands", amplitude=0.5, hold=3)
    dqn = agent("dqn", "dqn", LOW, actions=commands)
    weak = agent("weak", "open_loop", LOW / 10, amplitude=0.5)
    strong = agent("strong", "open_loop", HIGH, amplitude=1.0)
    assert "more than weak" in the_claim(OPEN_LOOP, dqn, weak, strong)["text"]
    assert "more than strong" in the_claim(OPEN_LOOP, agent("sac", "sac"), weak, strong)["text"]
    assert not [c for c in check(dqn, strong) if OPEN_LOOP in c["text"]]


@pytest.mark.parametrize(
    ("part", "first", "second", "verdict"),
    [
        (FLUID, {"fluidity": -LOW}, {"fluidity": -HIGH}, "supported"),
        (FLUID, {"fluidity": -HIGH}, {"fluidity": -LOW}, "refuted"),
        (FLUID, {"fluidity": -LOW}, {"fluidity": -TORN}, "inconclusive"),
        (BETTER, {"return": HIGH}, {"return": MIDDLE}, "supported"),
        (BETTER, {"return": 1.5 * MIDDLE}, {"return": MIDDLE}, "refuted"),
        (BETTER, {"return": 2 * LOW}, {"return": TORN}, "inconclusive"),
    ],
)
def test_sac_beside_dqn(part, first, second, verdict):
    sac, dqn = having(agent("sac", "sac"), **first), having(agent("dqn", "dqn"), **second)
    assert one_verdict(part, sac, dqn) == verdict


@pytest.mark.parametrize(
    ("budget", "verdict"), [(9000, "supported"), (200, "refuted"), (1000, "inconclusive")]
)
def test_training_time_is_that_in_all(budget, verdict):
    agents = agent("sac", "sac", budget=budget), agent("dqn", "dqn", budget=1000)
    assert one_verdict(SLOW, *agents) == verdict


@pytest.mark.parametrize(
    ("rounded", "verdict"),
    [(MIDDLE - 50, "supported"), (MIDDLE + 50, "refuted"), (MIDDLE, "inconclusive")],
)
@pytest.mark.parametrize("algorithm", ["sac", "pgpe"])
def test_rounding_is_judged_on_the_same_seeds(algorithm, rounded, verdict):
    # The spread over seeds exceeds the difference: only pairs tell them apart.
    learner = having(agent(algorithm, algorithm), {"rounded": {"return": rounded}})
    assert one_verdict(ROUNDED, learner) == verdict


def test_rounding_stiffens_where_the_robot_moves():
    rounded = -HIGH.copy()
    rounded[0] = np.nan
    variants = {"rounded": {"return": MIDDLE, "fluidity": rounded}}
    sac = having(agent("sac", "sac"), variants, fluidity=-LOW)
    claim = the_claim(STIFF, sac, agent("dqn", "dqn"))
    assert claim["p"] == 2 / 2**7
    assert "left out: 1 of SAC, rounded" in claim["evidence"]
    assert claim["plot"]["values"]["SAC, rounded"][0] is None
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


@pytest.mark.parametrize(
    ("reached_at", "verdict"), [(900, "supported"), (60, "refuted"), (100, "inconclusive")]
)
@pytest.mark.parametrize("unit", ["control steps", "training seconds"])
def test_heavy_means_more_effort_until_something_is_learned(reached_at, verdict, unit):
    pgpe = agent("pgpe", "pgpe", HIGH, reached_at=reached_at)
    rival = agent("sac", "sac", HIGH)
    assert one_verdict(f"more {unit}", pgpe, rival, RANDOM) == verdict


def test_a_rival_that_never_learned_in_its_shorter_budget_settles_nothing():
    pgpe = agent("pgpe", "pgpe", HIGH, reached_at=900)
    stuck = agent("dqn", "dqn", LOW, budget=500)
    claim = the_claim("more control steps", pgpe, stuck, RANDOM)
    assert (claim["verdict"], claim["p"]) == ("inconclusive", 1.0)
    assert "0 of 8 seeds got there" in claim["evidence"]
    longer = agent("dqn", "dqn", LOW, budget=2000)
    assert one_verdict("more control steps", pgpe, longer, RANDOM) == "refuted"


def test_a_return_counts_where_it_lasts():
    luck = {"evaluation_return_mean": np.array([9.0, np.nan, 0.0, 8.0, 9.0])}
    assert curves.sustained(luck, 5.0) == 3
    assert curves.sustained(luck, 8.0) == 4
    assert curves.sustained(luck, -1.0) == 0
    assert curves.sustained(luck, 9.0) is None


def test_random_policies_stay_below_what_counts_as_learning():
    generator = np.random.default_rng(0)
    returns = generator.gamma(2.0, 200.0, 1000)  # skewed, as theirs are
    threshold = out_of_luck(replace(RANDOM, episode_returns=returns), 5)
    assert threshold == pytest.approx(returns.mean() + 5 * returns.std() / np.sqrt(5))
    assert np.mean(generator.gamma(2.0, 200.0, (20_000, 5)).mean(axis=1) > threshold) < 0.001


@pytest.mark.parametrize(
    ("best_sample", "verdict"),
    [(MIDDLE - 1, "supported"), (MIDDLE + 1, "refuted"), (MIDDLE, "inconclusive")],
)
def test_the_centre_is_that_of_the_final_search(best_sample, verdict):
    variants = {"final": {"return": MIDDLE}, "best_sample": {"return": best_sample}}
    assert one_verdict(CENTRE, having(agent("pgpe", "pgpe", HIGH), variants)) == verdict


def test_a_constant_is_judged_beside_a_pgpe_like_it():
    own = agent("pgpe", "pgpe", MIDDLE)
    plain = agent("pgpe-plain", "pgpe", TORN, decrease_rewards_by=0.0)
    other = agent("pgpe-wide", "pgpe", TORN, decrease_rewards_by=0.0, population_size=40)
    assert lacks_constant(own, plain)
    assert not any(lacks_constant(*pair) for pair in ((plain, own), (own, own), (own, other)))
    assert one_verdict(CONSTANT, own, plain) == "supported"
    assert not any("pgpe-plain is robust" in claim["text"]
                   for claim in check(own, plain, agent("sac", "sac")))  # fmt: skip
    assert not any(CONSTANT in claim["text"] for claim in check(own, other))


@pytest.mark.parametrize(
    ("speed_up", "rivals", "verdict"),
    [(1.9, 1.1, "supported"), (1.0, 1.5, "refuted"), (1.5, 1.5, "inconclusive")],
)
def test_a_population_parallelises_if_cores_bring_more_than_to_one_policy(
    speed_up, rivals, verdict
):
    one = np.linspace(2.0, 2.1, 8)
    jitter = np.linspace(-0.02, 0.02, 8)
    pgpe, sac = (
        replace(agent(name, name), step_seconds={1: one, 2: one / (factor + jitter)})
        for name, factor in (("pgpe", speed_up), ("sac", rivals))
    )
    assert one_verdict(PARALLEL, pgpe, sac) == verdict


def test_one_core_says_nothing_of_parallel_work():
    alone = [replace(agent(n, n), step_seconds={1: np.ones(8)}) for n in ("pgpe", "sac")]
    claim = the_claim(PARALLEL, *alone)
    assert (claim["verdict"], claim["seeds_needed"]) == ("inconclusive", None)


def test_robots_are_compared_within_an_algorithm():
    plain = having(agent("sac-plain", "sac", robot="unedited"), apex=LOW)
    edited = having(agent("sac", "sac", robot="edited"), apex=HIGH)
    assert (robot_of(plain), robot_of(agent("dqn", "dqn"))) == ("unedited", "edited")
    found = check(plain, edited, agent("dqn", "dqn"))
    assert [claim["verdict"] for claim in found if LIGHTER in claim["text"]] == ["supported"]
    assert sum("sac-plain" in claim["text"] for claim in found) == 1  # it stands for nothing else


def test_agents_that_differ_by_more_than_their_robot_are_not_compared():
    plain = agent("plain", "open_loop", amplitude=1.0, robot="unedited")
    like = agent("like", "open_loop", amplitude=1.0, robot="edited")
    weaker = agent("weaker", "open_loop", amplitude=0.5, robot="edited")
    texts = [claim["text"] for claim in check(plain, like, weaker) if LIGHTER in claim["text"]]
    assert len(texts) == 1 and "like gets higher" in texts[0]


def test_claims_without_their_agents_are_left_out():
    dqn, sac, pgpe = (agent(name, name) for name in ("dqn", "sac", "pgpe"))
    for agents, parts in [
        ((RANDOM, METRONOME), []),
        ((RANDOM, dqn), [JUMPS]),
        ((dqn, METRONOME), [OPEN_LOOP]),
        ((dqn, sac), [FLUID, SLOW, BETTER]),
        ((pgpe, RANDOM), []),
        ((pgpe, sac), [ROBUST]),
        ((pgpe, sac, RANDOM), [ROBUST, HEAVY, HEAVY]),
    ]:
        texts = [claim["text"] for claim in check(*agents)]
        assert len(texts) == len(parts)
        assert all(part in text for part, text in zip(parts, texts, strict=True))


def test_agents_stand_for_their_algorithm_whatever_their_name():
    buttons, levers = agent("buttons", "dqn"), agent("levers", "dqn")
    texts = [claim["text"] for claim in check(agent("noise", "random"), buttons, levers)]
    assert [text.split(":")[0] for text in texts] == [
        "buttons learns to jump", "levers learns to jump"
    ]  # fmt: skip
    assert all("noise" in text for text in texts)


@pytest.mark.parametrize(
    ("returns", "verdict"), [(HIGH, "supported"), (LOW, "refuted"), (MIDDLE, "inconclusive")]
)
def test_an_action_set_is_judged_beside_a_pgpe_like_it(returns, verdict):
    torques = agent("pgpe", "pgpe", returns, actions=SimpleNamespace(kind="torques"))
    commands = agent("typing", "pgpe", MIDDLE, actions=SimpleNamespace(kind="commands"))
    assert one_verdict(ROUNDED, torques, commands) == verdict
    found = check(torques, commands, agent("sac", "sac"))
    assert sum("typing" in claim["text"] for claim in found) == 1  # it stands for nothing else


@pytest.mark.parametrize("rival", ["ppo", "sac"])
@pytest.mark.parametrize(("returns", "verdict"), [(MIDDLE, "supported"), (TORN, "inconclusive")])
def test_a2c_is_the_less_steady_one(rival, returns, verdict):
    assert (
        one_verdict("steadier than", agent(rival, rival, returns), agent("a2c", "a2c", TORN))
        == verdict
    )


@pytest.mark.parametrize(
    ("part", "fast", "slow"),
    [("more efficient than", "ppo", "a2c"), ("more efficient than", "sac", "a2c"),
     ("The more complex", "dqn", "ddpg"), ("The more complex", "ddpg", "td3")],
)  # fmt: skip
@pytest.mark.parametrize(
    ("reached_at", "verdict"), [(900, "supported"), (60, "refuted"), (100, "inconclusive")]
)
def test_effort_is_counted_in_control_steps(part, fast, slow, reached_at, verdict):
    slower = agent(slow, slow, HIGH, reached_at)
    assert one_verdict(part, agent(fast, fast, HIGH, 100), slower, RANDOM) == verdict


def test_a_second_critic_is_judged_beside_a_td3_like_it():
    two = agent("td3", "td3", HIGH, n_critics=2)
    one = agent("lonely", "td3", LOW, n_critics=1)
    other = agent("wide", "td3", LOW, n_critics=1, gamma=0.9)
    assert one_verdict("A second critic", two, one) == "supported"
    assert not any("A second critic" in claim["text"] for claim in check(two, other))
    found = check(two, one, agent("ddpg", "ddpg"), RANDOM)
    assert sum("lonely" in claim["text"] for claim in found) == 1


@pytest.mark.parametrize(
    ("returns", "verdict"), [(LOW, "supported"), (HIGH, "refuted"), (MIDDLE, "inconclusive")]
)
def test_pgpe_is_compared_with_all_evolution(returns, verdict):
    rivals = [agent(name, name, returns) for name in ("snes", "cmaes")]
    found = check(agent("pgpe", "pgpe", MIDDLE), *rivals)
    told = [claim["verdict"] for claim in found if claim["statement"] == 12]
    assert told == [verdict] * 2


@pytest.mark.parametrize(
    ("returns", "verdict"), [(LOW, "supported"), (HIGH, "refuted"), (MIDDLE, "inconclusive")]
)
@pytest.mark.parametrize("algorithm", ["sac", "dqn"])
def test_evolution_is_compared_with_agents_of_sparse_rewards(algorithm, returns, verdict):
    pgpe, dense = agent("pgpe", "pgpe", MIDDLE), agent(algorithm, algorithm, HIGH)
    sparse = agent("blindfolded", algorithm, returns, sparse_rewards=True)
    assert one_verdict("rewards are sparse", pgpe, dense, sparse) == verdict
    found = check(pgpe, dense, sparse, RANDOM, agent("dqn", "dqn"))
    assert sum("blindfolded" in claim["text"] for claim in found) == 1


@pytest.mark.parametrize(
    ("reached_at", "verdict"), [(900, "supported"), (60, "refuted"), (100, "inconclusive")]
)
def test_an_imitator_is_compared_with_whom_it_imitates(reached_at, verdict):
    taught = replace(agent("parrot", "bc", HIGH, 100), demonstrator="sac")
    sac, other = agent("sac", "sac", HIGH, reached_at), agent("wide", "sac", HIGH, 60)
    claim = the_claim("skips exploration", taught, sac, other, RANDOM)
    assert (claim["verdict"], claim["statement"]) == (verdict, 16)
