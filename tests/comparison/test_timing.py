"""What training took, the content of `results/speed.json`, and the claims that rest on it."""

import json

import numpy as np
import pytest
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
from jumping_ant.params.claims import Claim
from jumping_ant.training import curves

AGENTS = {"random": "random", "dqn": "dqn", "sac": "sac", "pgpe": "pgpe"}
SEEDS = [3, 1, 7, 5]
ASKED = [
    Claim(text=measure, measure=measure, agent="pgpe", against=against)
    for measure in ("return", "speed_up", "seconds_per_step")
    for against in ("sac", "random")
]


def summarize(root, agents):
    params = make_params(agents, SEEDS)
    results = load(root, params, curves.read_timed)
    two = {1: np.linspace(2.0, 2.3, 4), 2: np.linspace(1.0, 1.3, 4)}
    scaling = {name: {} if algorithm == "random" else two for name, algorithm in agents.items()}
    return timing.summarize(params, ASKED, results, comparison.summarize(results, COMPARE), scaling)


def test_the_summary_follows_its_contract(tmp_path):
    write_project(tmp_path, AGENTS, SEEDS)
    summary = summarize(tmp_path, AGENTS)
    json.dumps(summary, allow_nan=False)
    assert list(summary) == ["agents", "equal_seconds", "pareto_seconds", "claims", "not_asked"]
    agents = summary["agents"]
    assert list(agents) == list(AGENTS)
    assert agents["random"] == {"train_seconds": 0.0}
    assert agents["dqn"]["train_seconds"] == 500.0  # 1000 control steps
    assert summary["equal_seconds"] == 100.0  # those of SAC
    assert agents["sac"]["return_at_equal_seconds"]["worst"] == pytest.approx(3000)
    assert agents["dqn"]["return_at_equal_seconds"] is None  # evaluated later
    assert summary["pareto_seconds"] == ["sac", "pgpe"]
    assert [claim["agents"] for claim in summary["claims"]] == [["pgpe", "sac"]] * 2
    assert [it["reason"] for it in summary["not_asked"]] == [
        f"no {measure} of random" for measure in ("speed_up", "seconds_per_step")
    ]
    speed_up, pace = (claim["plot"]["values"]["PGPE"] for claim in summary["claims"])
    assert speed_up == pytest.approx(np.linspace(2.0, 2.3, 4) / np.linspace(1.0, 1.3, 4))
    assert pace == [0.5] * 4


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
