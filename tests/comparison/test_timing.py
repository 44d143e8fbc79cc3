"""What training took: the content of `results/speed.json`."""

import json
from pathlib import Path
from typing import Any

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
from jumping_ant.training import curves

AGENTS = {"random": "random", "dqn": "dqn", "sac": "sac", "pgpe": "pgpe"}
SEEDS = [3, 1, 7, 5]


def summarize(root: Path, agents: dict[str, str]) -> dict[str, Any]:
    params = make_params(agents, SEEDS)
    results = load(root, params, curves.read_timed)
    two = {1: np.linspace(2.0, 2.3, 4), 2: np.linspace(1.0, 1.3, 4)}
    scaling = {name: {} if algorithm == "random" else two for name, algorithm in agents.items()}
    return timing.summarize(params, results, comparison.summarize(results, COMPARE), scaling)


def test_the_summary_follows_its_contract(tmp_path: Path) -> None:
    write_project(tmp_path, AGENTS, SEEDS)
    found = summarize(tmp_path, AGENTS)
    json.dumps(found, allow_nan=False)
    assert list(found) == ["agents", "equal_seconds", "pareto_seconds", "claims"]
    agents = found["agents"]
    assert list(agents) == list(AGENTS)
    assert agents["random"] == {"train_seconds": 0.0}
    assert agents["dqn"]["train_seconds"] == 500.0  # 1000 control steps
    assert found["equal_seconds"] == 100.0  # those of SAC
    assert agents["sac"]["return_at_equal_seconds"]["worst"] == pytest.approx(3000)
    assert agents["dqn"]["return_at_equal_seconds"] is None  # evaluated later
    assert found["pareto_seconds"] == ["sac", "pgpe"]
    assert [claim["text"].split(":")[0] for claim in found["claims"]] == [
        "SAC takes more time to train than DQN, per control step.",
        *["PGPE is computationally heavy", "The population of PGPE parallelises"] * 2,
    ]


def test_returns_after_equal_seconds_lie_on_the_learning_curves(tmp_path: Path) -> None:
    agents = {name: AGENTS[name] for name in ("random", "sac", "dqn")}
    write_project(tmp_path, agents, SEEDS)
    rows = curve_rows(400, 3000.0)  # evaluated after 100, 200, 300, 400 steps
    for seed in SEEDS:
        write_curve(tmp_path, "sac", seed, rows)
    timed = [row for seed in SEEDS for row in timing_rows("sac", seed, rows, pace=2.0)]
    write_csv(Paths(tmp_path).agent("sac").timing, timed)
    found = summarize(tmp_path, agents)  # DQN returns half after 125 s, all of it after 250 s
    assert found["equal_seconds"] == 500.0
    returns = {name: own.get("return_at_equal_seconds") for name, own in found["agents"].items()}
    assert returns["dqn"]["iqm"] == pytest.approx(715)
    assert returns["sac"]["iqm"] == pytest.approx(3000)


def test_baselines_alone_have_no_front(tmp_path: Path) -> None:
    write_project(tmp_path, {"random": "random"}, SEEDS)
    found = summarize(tmp_path, {"random": "random"})
    assert (found["equal_seconds"], found["pareto_seconds"]) == (None, [])
