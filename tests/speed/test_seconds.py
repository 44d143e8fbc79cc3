import json
from pathlib import Path

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
from timed_project import Timed

from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import charting, comparison
from jumping_ant.comparison.figures import figures
from jumping_ant.comparison.results import load
from jumping_ant.experiment import curves
from jumping_ant.speed import seconds

AGENTS = {"random": "random", "sac-long": "sac", "dqn": "dqn"}
SEEDS = [3, 1, 7, 5]
PARAMS = make_params(AGENTS, SEEDS)


def summarize(root: Path) -> dict:
    results = load(root, PARAMS, curves.read_timed)
    compared = comparison.summarize(results, COMPARE)
    return seconds.summarize(root, PARAMS, results, compared)


def test_the_summary_follows_its_contract(timed: Timed) -> None:
    json.dumps(timed.seconds, allow_nan=False)
    assert list(timed.seconds) == ["agents", "equal_seconds", "pareto_seconds", "claims"]
    agents = timed.seconds["agents"]
    assert list(agents) == list(timed.params.agents)
    assert agents["random"] == {"train_seconds": 0.0}
    assert agents["dqn"]["train_seconds"] == 500.0  # 1000 control steps
    assert timed.seconds["equal_seconds"] == 100.0  # those of SAC
    assert agents["sac"]["return_at_equal_seconds"]["worst"] == pytest.approx(3000)
    assert agents["dqn"]["return_at_equal_seconds"] is None  # evaluated later
    assert timed.seconds["pareto_seconds"] == ["sac", "pgpe"]
    texts = [claim["text"].split(":")[0] for claim in timed.seconds["claims"]]
    assert texts == [
        "SAC takes more time to train than DQN, per control step.",
        *["PGPE is computationally heavy", "The population of PGPE parallelises"] * 2,
    ]


def test_returns_after_equal_seconds_lie_on_the_learning_curves(tmp_path: Path) -> None:
    write_project(tmp_path, AGENTS, SEEDS)
    rows = curve_rows(400, 3000.0)  # evaluated after 100, 200, 300, 400 steps
    for seed in SEEDS:
        write_curve(tmp_path, "sac-long", seed, rows)
    timing = [row for seed in SEEDS for row in timing_rows("sac-long", seed, rows, pace=2.0)]
    write_csv(Paths(tmp_path).agent("sac-long").timing, timing)
    summary = summarize(tmp_path)  # DQN returns half after 125 s, all of it after 250 s
    assert summary["equal_seconds"] == 500.0
    agents = summary["agents"]
    assert agents["dqn"]["return_at_equal_seconds"]["iqm"] == pytest.approx(715)
    assert agents["sac-long"]["return_at_equal_seconds"]["iqm"] == pytest.approx(3000)


def test_baselines_alone_have_no_front(tmp_path: Path) -> None:
    write_project(tmp_path, {"random": "random"}, SEEDS)
    params = make_params({"random": "random"}, SEEDS)
    results = load(tmp_path, params, curves.read_timed)
    compared = comparison.summarize(results, COMPARE)
    summary = seconds.summarize(tmp_path, params, results, compared)
    assert (summary["equal_seconds"], summary["pareto_seconds"]) == (None, [])


def test_learning_curves_go_by_the_mean_clock(timed: Timed) -> None:
    by_steps = comparison.learning_curves(timed.results, COMPARE)
    learned = comparison.learning_curves(timed.results, COMPARE, "seconds")
    np.testing.assert_allclose(learned["dqn"].trained, [125, 250, 375, 500])
    np.testing.assert_array_equal(learned["dqn"].returns.value, by_steps["dqn"].returns.value)
    np.testing.assert_allclose(learned["random"].trained, [25, 4000])  # SAC's first, PGPE's last
    rows = comparison.curve_rows(learned, charting.families(timed.results), "seconds")
    assert list(rows[0]) == ["agent", "seconds", "return_iqm", "low", "high", "colour", "line"]


def test_figures_are_against_seconds(timed: Timed) -> None:
    learned = comparison.learning_curves(timed.results, COMPARE, "seconds")
    drawn = figures.draw_costs(
        timed.results, learned, timed.summary, timed.seconds["claims"], 0.95, "seconds"
    )
    assert list(drawn) == ["learning_curves", "efficiency", "claims"]
    for name in ("learning_curves", "efficiency"):
        (axes,) = drawn[name].axes
        assert axes.get_xlabel() == "Training time per seed [s]"
    lines = {line.get_label(): line for line in drawn["learning_curves"].axes[0].lines}
    np.testing.assert_allclose(lines["SAC"].get_xdata(), learned["sac"].trained)
    (front,) = [
        line for line in drawn["efficiency"].axes[0].lines if line.get_drawstyle() == "steps-post"
    ]
    assert list(front.get_xdata()) == [100.0, 4000.0, 4000.0]
    assert len(drawn["claims"].axes) == 5


@pytest.mark.parametrize(
    ("name", "stage"), [("timing.csv", "train@dqn"), ("scaling.csv", "scaling@dqn")]
)
def test_a_missing_table_names_the_stage_to_run(tmp_path: Path, name: str, stage: str) -> None:
    write_project(tmp_path, AGENTS, SEEDS)
    path = tmp_path / "results" / "timing" / "dqn" / name
    path.unlink()
    with pytest.raises(InputError, match=f"{path}: No such file.*; run `dvc repro {stage}`"):
        summarize(tmp_path)
