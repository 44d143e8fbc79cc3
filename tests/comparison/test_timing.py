"""What training took, the content of `results/speed.json`, and the claims that rest on it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from small_field import HIGH, RANDOM, agent, check, the_claim
from small_project import (
    COMPARE,
    curve_rows,
    make_params,
    timing_rows,
    write_csv,
    write_curve,
    write_project,
)

from jumping_ant.base.paths import Paths
from jumping_ant.comparison import comparison, timing
from jumping_ant.comparison.results import load
from jumping_ant.params import presets
from jumping_ant.training import curves

AGENTS = {"random": "random", "dqn": "dqn", "sac": "sac", "pgpe": "pgpe"}
SEEDS = [3, 1, 7, 5]
UNTIMED = timing.table(dict.fromkeys(("pgpe", "sac", "dqn"), {}))
STEP, HEAVY, PARALLEL = "per control step", "is computationally heavy", "parallelises"


def summarize(root, agents):
    params = make_params(agents, SEEDS)
    results = load(root, params, curves.read_timed)
    two = {1: np.linspace(2.0, 2.3, 4), 2: np.linspace(1.0, 1.3, 4)}
    scaling = {name: {} if algorithm == "random" else two for name, algorithm in agents.items()}
    return timing.summarize(params, results, comparison.summarize(results, COMPARE), scaling)


def test_the_summary_follows_its_contract(tmp_path):
    write_project(tmp_path, AGENTS, SEEDS)
    summary = summarize(tmp_path, AGENTS)
    json.dumps(summary, allow_nan=False)
    assert list(summary) == ["agents", "equal_seconds", "pareto_seconds", "claims"]
    agents = summary["agents"]
    assert list(agents) == list(AGENTS)
    assert agents["random"] == {"train_seconds": 0.0}
    assert agents["dqn"]["train_seconds"] == 500.0  # 1000 control steps
    assert summary["equal_seconds"] == 100.0  # those of SAC
    assert agents["sac"]["return_at_equal_seconds"]["worst"] == pytest.approx(3000)
    assert agents["dqn"]["return_at_equal_seconds"] is None  # evaluated later
    assert summary["pareto_seconds"] == ["sac", "pgpe"]
    assert [claim["text"].split(":")[0] for claim in summary["claims"]] == [
        "SAC takes more time to train than DQN, per control step.",
        *["PGPE is computationally heavy", "The population of PGPE parallelises"] * 2,
    ]


def test_an_agents_seconds_are_the_mean_of_its_seeds(tmp_path):
    write_project(tmp_path, AGENTS, SEEDS)
    curve = curve_rows(200, 3000.0)
    paces = zip(SEEDS, (1.0, 2.0, 3.0, 10.0), strict=True)
    timed = [row for seed, pace in paces for row in timing_rows("sac", seed, curve, pace)]
    write_csv(Paths(tmp_path).agent("sac").timing, timed)
    assert summarize(tmp_path, AGENTS)["agents"]["sac"]["train_seconds"] == 4.0 * 200


def test_returns_after_equal_seconds_lie_on_the_learning_curves(tmp_path):
    agents = {name: AGENTS[name] for name in ("random", "sac", "dqn")}
    write_project(tmp_path, agents, SEEDS)
    rows = curve_rows(400, 3000.0)  # evaluated after 100, 200, 300, 400 steps
    for seed in SEEDS:
        write_curve(tmp_path, "sac", seed, rows)
    timed = [row for seed in SEEDS for row in timing_rows("sac", seed, rows, pace=2.0)]
    write_csv(Paths(tmp_path).agent("sac").timing, timed)
    summary = summarize(tmp_path, agents)  # DQN returns half after 125 s, all of it after 250 s
    assert summary["equal_seconds"] == 500.0
    for name, level in (("dqn", 715), ("sac", 3000)):
        early = summary["agents"][name]["return_at_equal_seconds"]
        assert early["iqm"] == pytest.approx(level)


def test_baselines_alone_have_no_front(tmp_path):
    write_project(tmp_path, {"random": "random"}, SEEDS)
    summary = summarize(tmp_path, {"random": "random"})
    assert (summary["equal_seconds"], summary["pareto_seconds"]) == (None, [])


@pytest.mark.parametrize(
    ("pace", "verdict"), [(9.0, "supported"), (0.2, "refuted"), (1.0, "inconclusive")]
)
def test_training_time_is_that_of_a_control_step(pace, verdict):
    sac, dqn = agent("sac", "sac", budget=500), agent("dqn", "dqn", budget=2000)
    slowed = {
        seed: curve | {"seconds": pace * curve["seconds"]} for seed, curve in sac.curves.items()
    }
    (claim,) = check(replace(sac, curves=slowed), dqn, table=UNTIMED)
    assert (STEP in claim["text"], claim["verdict"]) == (True, verdict)


@pytest.mark.parametrize(
    ("budget", "verdict"), [(9_000_000, "supported"), (200, "refuted"), (1_000_000, "inconclusive")]
)
def test_training_time_in_all_is_compared_with_the_articles_budgets(budget, verdict):
    sac = agent("sac", "sac", budget=budget, total_steps=100_000)
    dqn = agent("dqn", "dqn", budget=1_000_000, total_steps=1_000_000)
    assert the_claim("in all", sac, dqn, table=UNTIMED)["verdict"] == verdict
    other = agent("dqn", "dqn", budget=1_000_000, total_steps=210_000)
    assert not any("in all" in claim["text"] for claim in check(sac, other, table=UNTIMED))


def test_the_articles_budgets_are_those_of_its_preset():
    agents = presets.load("article").agents
    for name, steps in timing.ARTICLES_STEPS.items():
        assert agents[name].max_env_steps == steps


@pytest.mark.parametrize(
    ("reached_at", "verdict", "is_small"),
    [
        (100, "equivalent", True),
        (115, "supported", True),
        (140, "supported", False),
        (60, "refuted", False),
    ],
)
def test_effort_is_the_seconds_until_something_is_learned(reached_at, verdict, is_small):
    agents = agent("dqn", "dqn", HIGH), agent("pgpe", "pgpe", HIGH, reached_at), RANDOM
    claim = the_claim(HEAVY, *agents, table=UNTIMED)
    assert claim["margin"] == {"low": 0.8, "high": 1.25}
    assert (claim["verdict"], claim["p_equivalence_adjusted"] < 0.05) == (verdict, is_small)
    assert claim["plot"]["axis"].startswith("Training seconds to a return above")


@pytest.mark.parametrize(
    ("speed_up", "rivals", "verdict"),
    [(1.9, 1.1, "supported"), (1.0, 1.5, "refuted"), (1.5, 1.5, "inconclusive")],
)
def test_a_population_parallelises_if_cores_bring_more_than_to_one_policy(
    speed_up, rivals, verdict
):
    one, jitter = np.linspace(2.0, 2.1, 8), np.linspace(-0.02, 0.02, 8)
    scaling = {
        name: {1: one, 2: one / (factor + jitter)}
        for name, factor in (("pgpe", speed_up), ("sac", rivals))
    }
    agents = [agent(name, name) for name in scaling]
    assert the_claim(PARALLEL, *agents, table=timing.table(scaling))["verdict"] == verdict


def test_one_core_says_nothing_of_parallel_work():
    agents = [agent(name, name) for name in ("pgpe", "sac")]
    table = timing.table({one.name: {1: np.ones(8)} for one in agents})
    claim = the_claim(PARALLEL, *agents, table=table)
    assert (claim["verdict"], claim["effect"]["value"]) == ("inconclusive", None)


@pytest.mark.parametrize(
    ("names", "parts"),
    [
        (("dqn", "sac"), [STEP]),
        (("pgpe", "sac"), []),
        (("pgpe", "sac", "random"), [HEAVY]),
        (("pgpe", "dqn", "sac", "random"), [STEP, HEAVY, HEAVY]),
    ],
)
def test_they_are_corrected_among_themselves_and_left_out_without_their_agents(names, parts):
    claims = check(*(RANDOM if name == "random" else agent(name, name) for name in names),
                   table=UNTIMED)  # fmt: skip
    assert len(claims) == len(parts)
    for claim, part in zip(claims, parts, strict=True):
        assert part in claim["text"]
        assert f"among {len(parts)} claims" in claim["evidence"]
