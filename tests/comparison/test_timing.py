"""What training took, the content of `results/speed.json`, and the claims that rest on it."""

import json

import pytest
from small_project import (
    COMPARE,
    curve_rows,
    make_params,
    timing_rows,
    write_csv,
    write_project,
)

from jumping_ant.base.paths import Paths
from jumping_ant.comparison import comparison, timing
from jumping_ant.comparison.results import load
from jumping_ant.params.claims import Claim
from jumping_ant.training import curves
from jumping_ant.training.scaling import Piece

AGENTS = {"random": "random", "dqn": "dqn", "sac": "sac", "pgpe": "pgpe"}
SEEDS = [3, 1, 7, 5]
ASKED = [
    Claim(text=measure, measure=measure, agent="pgpe", against=against)
    for measure in ("return", "speed_up", "seconds_per_step")
    for against in ("sac", "random")
]


PACES = {"dqn": 0.001, "sac": 0.01, "pgpe": 0.0001}  # CPU seconds of a control step


def pieces(agents):
    """Two threads speed PGPE up 1.9 times; seconds by the clock are twice the CPU's."""
    return [
        Piece(name, repeat, threads, 100, 200 * pace / (1.9 if threads == 2 else 1), 100 * pace)
        for repeat in range(8)
        for name in agents
        if (pace := (1 + 0.001 * repeat) * PACES.get(name, 0))
        for threads in (1, 2)
    ]


def summarize(root, agents):
    params = make_params(agents, SEEDS)
    results = load(root, params, curves.read_timed)
    compared = comparison.summarize(results, COMPARE)
    return timing.summarize(params, ASKED, results, compared, pieces(agents))


def test_the_summary_follows_its_contract(tmp_path):
    write_project(tmp_path, AGENTS, SEEDS)
    summary = summarize(tmp_path, AGENTS)
    json.dumps(summary, allow_nan=False)
    assert list(summary) == [
        *("machine", "agents", "equal_seconds", "pareto_seconds", "claims", "not_asked")
    ]
    assert summary["machine"]["cpu"]
    agents = summary["agents"]
    assert list(agents) == list(AGENTS)
    assert agents["random"] == {"train_seconds": 0.0, "wall_seconds": 0.0}
    assert [agents[name]["train_seconds"] for name in ("dqn", "sac", "pgpe")] == pytest.approx(
        [1.0, 2.0, 0.8], rel=0.01  # 1,000, 200 and 8,000 control steps
    )  # fmt: skip
    assert agents["dqn"]["wall_seconds"] == 500.0
    assert summary["equal_seconds"] == agents["pgpe"]["train_seconds"]
    assert agents["pgpe"]["return_at_equal_seconds"]["worst"] == pytest.approx(5000)
    assert agents["dqn"]["return_at_equal_seconds"]["iqm"] == pytest.approx(715)
    assert summary["pareto_seconds"] == ["pgpe"]
    assert [claim["agents"] for claim in summary["claims"]] == [["pgpe", "sac"]] * 2
    assert [it["reason"] for it in summary["not_asked"]] == [
        f"no {measure} of random" for measure in ("speed_up", "seconds_per_step")
    ]
    speed_up, pace = (claim["plot"]["values"]["PGPE"] for claim in summary["claims"])
    assert speed_up == pytest.approx([1.9] * 8)
    assert pace == pytest.approx([(1 + 0.001 * repeat) * 0.0001 for repeat in range(8)])


def test_seconds_by_the_clock_of_training_decide_nothing(tmp_path):
    write_project(tmp_path, AGENTS, SEEDS)
    before = summarize(tmp_path, AGENTS)
    curve = curve_rows(200, 3000.0)
    paces = zip(SEEDS, (1.0, 2.0, 3.0, 10.0), strict=True)
    timed = [row for seed, pace in paces for row in timing_rows("sac", seed, curve, pace)]
    write_csv(Paths(tmp_path).agent("sac").timing, timed)
    after = summarize(tmp_path, AGENTS)
    assert after["agents"]["sac"].pop("wall_seconds") == 4.0 * 200
    del before["agents"]["sac"]["wall_seconds"]
    assert after == before


def test_baselines_alone_have_no_front(tmp_path):
    write_project(tmp_path, {"random": "random"}, SEEDS)
    summary = summarize(tmp_path, {"random": "random"})
    assert (summary["equal_seconds"], summary["pareto_seconds"]) == (None, [])
