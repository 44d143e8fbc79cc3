"""The comparison: what `results/comparison.json` and `results/plots/` hold."""

import json

import numpy as np
import pytest
from small_project import (
    COMPARE,
    EPISODES,
    curve_rows,
    episode_row,
    make_params,
    read_csv,
    write_csv,
    write_curve,
    write_project,
)

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import comparison, runs
from jumping_ant.comparison.results import load
from jumping_ant.media.style import DASHES, LINES, looks
from jumping_ant.training.curves import evaluations

AGENTS = {"random": "random", "sac-long": "sac", "dqn": "dqn"}
SEEDS = [3, 1, 7, 5]  # any numbers in any order
PARAMS = make_params(AGENTS, SEEDS)


@pytest.fixture
def project(tmp_path):
    write_project(tmp_path, AGENTS, SEEDS)
    return tmp_path


def summarize(root, params=PARAMS):
    return comparison.summarize(load(root, params), COMPARE)


def test_seeds_are_means_over_their_episodes(project):
    results = load(project, PARAMS)
    np.testing.assert_allclose(results["dqn"].quantities["return"], [700, 710, 720, 730])
    np.testing.assert_allclose(results["dqn"].quantities["work"], [1400, 1420, 1440, 1460])
    assert list(results["dqn"].curves) == SEEDS


def test_summary_follows_its_contract(project):
    summary = summarize(project)
    json.dumps(summary, allow_nan=False)
    assert list(summary["agents"]) == list(AGENTS)
    dqn = summary["agents"]["dqn"]
    assert list(dqn) == [
        "seeds", "return", "peak_height", "torque_change", "length", "apex", "mean_height", "jumps",
        "airborne_seconds", "flight", "fluidity", "work", "drift", "survived",
        "survivors_return", "falls_per_1000_jumps", "env_steps", "cost_steps",
        "return_at_equal_steps",
    ]  # fmt: skip
    assert (dqn["seeds"], dqn["env_steps"]) == (4, 1000)
    assert dqn["return"]["iqm"] == pytest.approx(715)  # the middle two of 700 ... 730
    assert 690 < dqn["return"]["low"] < 715 < dqn["return"]["high"] < 740
    assert dqn["return"]["mean"] == pytest.approx(715)
    assert (dqn["return"]["worst"], dqn["return"]["best"]) == (700, 730)
    assert set(dqn["survived"].values()) == {1.0}
    assert summary["agents"]["random"]["env_steps"] == 0


def test_the_ranking_goes_by_interquartile_means(project):
    results = load(project, PARAMS)
    agents = summarize(project)["agents"]
    assert comparison.ranking(agents) == ["sac-long", "dqn", "random"]
    assert comparison.best_baseline(results, agents) == "random"
    del agents["random"]
    assert comparison.best_baseline(results, agents) is None


@pytest.mark.parametrize(
    ("points", "front"),
    [
        ({}, []),
        ({"a": (1, 5)}, ["a"]),
        ({"dear": (3, 9), "cheap": (1, 5), "mid": (2, 7)}, ["cheap", "mid", "dear"]),
        ({"a": (1, 5), "worse": (2, 4), "b": (3, 6)}, ["a", "b"]),
        ({"a": (1, 5), "as good": (2, 5)}, ["a"]),
        ({"worse": (1, 4), "a": (1, 5)}, ["a"]),
        ({"first": (1, 5), "twin": (1, 5)}, ["first"]),
    ],
)
def test_the_pareto_front_holds_what_nothing_cheaper_exceeds(points, front):
    costs = {name: cost for name, (cost, _) in points.items()}
    gains = {name: gain for name, (_, gain) in points.items()}
    assert comparison.pareto_front(costs, gains) == front


def test_fronts_are_of_learners(project):
    # SAC returns more than DQN, after fewer steps; random needs none at all.
    assert summarize(project)["pareto_steps"] == ["sac-long"]
    agents = {"dqn": "dqn", "pgpe": "pgpe"}  # 1000 steps to 700, 8000 steps to 5000
    write_project(project, agents, SEEDS)
    assert summarize(project, make_params(agents, SEEDS))["pareto_steps"] == ["dqn", "pgpe"]
    assert summarize(project, make_params({"random": "random"}, SEEDS))["pareto_steps"] == []


def test_learners_are_compared_at_the_smallest_budget(project):
    # Of 200 control steps SAC's; DQN, evaluated at 250, had returned half at 250.
    summary = summarize(project)
    assert summary["equal_steps"] == 200
    sac, dqn = summary["agents"]["sac-long"], summary["agents"]["dqn"]
    assert sac["return_at_equal_steps"]["iqm"] == sac["return"]["iqm"]
    assert dqn["return_at_equal_steps"] is None
    assert "return_at_equal_steps" not in summary["agents"]["random"]


def test_variants_are_read_like_the_policies(project):
    variants = load(project, PARAMS)["sac-long"].variants
    assert list(variants) == ["final"]
    np.testing.assert_allclose(variants["final"]["return"], [2993, 3003, 3013, 3023])


def test_every_ordered_pair_has_a_probability_that_is_its_reverses_complement(project):
    for name, values in {"dqn": [1, 5, 6, 9], "sac-long": [2, 4, 7, 8]}.items():
        rows = [
            episode_row(name, seed, episode, value)
            for seed, value in zip(SEEDS, values, strict=True)
            for episode in range(EPISODES)
        ]
        write_csv(project / "results" / "agents" / name / "episodes.csv", rows)
    pairs = summarize(project)["probability_of_improvement"]
    assert list(pairs) == [
        "random>sac-long", "random>dqn", "sac-long>random", "sac-long>dqn", "dqn>random",
        "dqn>sac-long",
    ]  # fmt: skip
    assert pairs["random>dqn"] == {"p": 1.0, "low": 1.0, "high": 1.0}
    forth, back = pairs["dqn>sac-long"], pairs["sac-long>dqn"]
    assert forth["p"] == pytest.approx(8 / 16)  # 0 + 2 + 2 + 4
    assert forth["low"] < 0.5 < forth["high"]
    assert (back["low"], back["high"]) == pytest.approx((1 - forth["high"], 1 - forth["low"]))


def test_a_single_seed_is_compared_without_spread(tmp_path):
    write_project(tmp_path, AGENTS, [0])
    summary = summarize(tmp_path, make_params(AGENTS, [0]))
    assert set(summary["agents"]["dqn"]["return"].values()) == {700.0}
    assert summary["probability_of_improvement"]["dqn>random"]["p"] == 1.0


def test_learning_curves_are_means_over_seeds_where_policies_were_evaluated(project):
    curve = comparison.learning_curves(load(project, PARAMS), COMPARE)["dqn"]
    np.testing.assert_allclose(curve.trained, [250, 500, 750, 1000])
    np.testing.assert_allclose(curve.returns.value, [357.5, 715, 715, 715])
    write_curve(project, "dqn", 7, curve_rows(2000, 700.0))  # the others stop at 1000
    curve = comparison.learning_curves(load(project, PARAMS), COMPARE)["dqn"]
    np.testing.assert_allclose(curve.trained, [500, 1000, 1500, 2000])
    np.testing.assert_allclose(curve.returns.value[-1], (700 + 710) / 2)  # 700, 700, 710, 730


@pytest.mark.parametrize(("algorithm", "level"), [("random", 345), ("open_loop", 515)])
def test_the_baselines_curve_is_level_at_its_end_over_the_others_budgets(
    tmp_path, algorithm, level
):
    agents = AGENTS | {"random": algorithm}  # a search for a rhythm has evaluations between
    write_project(tmp_path, agents, SEEDS)
    curves = comparison.learning_curves(load(tmp_path, make_params(agents, SEEDS)), COMPARE)
    np.testing.assert_allclose(curves["random"].trained, [50, 1000])  # SAC's first, DQN's last
    np.testing.assert_allclose(curves["random"].returns.value, [level, level])


def test_baselines_alone_can_be_compared(tmp_path):
    agents = {"random": "random", "other": "random"}
    write_project(tmp_path, agents, SEEDS)
    results = load(tmp_path, make_params(agents, SEEDS))
    curves = comparison.learning_curves(results, COMPARE)
    np.testing.assert_allclose(curves["other"].trained, [0, 0])
    pair = comparison.summarize(results, COMPARE)["probability_of_improvement"]["random>other"]
    assert pair["p"] == 0.5


def test_dvc_plots_take_each_agents_look_by_name(project):
    results = load(project, PARAMS)
    families = {name: agent.family for name, agent in results.items()}
    rows = comparison.curve_rows(comparison.learning_curves(results, COMPARE), families)
    assert list(rows[0]) == [
        "agent", "env_steps", "return_iqm", "low", "high", "colour", "line",
    ]  # fmt: skip
    assert [row["agent"] for row in rows] == ["random"] * 2 + ["sac-long"] * 4 + ["dqn"] * 4
    drawn = looks(families)
    for row in rows:
        look = drawn[row["agent"]]
        assert (row["colour"], row["line"]) == (look.colour, look.line)
    template = json.loads((PROJECT_ROOT / ".dvc/plots/agents.json").read_text(encoding="utf-8"))
    for view in template["hconcat"]:
        assert view["encoding"]["color"] == {"field": "colour", "type": "nominal", "scale": None}
        assert view["encoding"]["strokeDash"]["field"] == "line"
        assert set(view["encoding"]["strokeDash"]["scale"]["domain"]) == {*LINES, *DASHES}


@pytest.mark.parametrize(
    ("path", "stage"),
    [
        ("results/agents/sac-long/episodes.csv", "evaluate@sac-long"),
        ("models/dqn/seed-7/curve.csv", "train@dqn"),
    ],
)
def test_a_missing_file_names_the_stage_to_run(project, path, stage):
    (project / path).unlink()
    with pytest.raises(InputError, match="No such file") as error:
        load(project, PARAMS)
    assert path in str(error.value)
    assert f"dvc repro {stage}" in str(error.value)


def empty_fluidity(project, num_episodes):
    """Empty the fluidity of the first episodes of DQN's seeds, by seed."""
    path = project / "results" / "agents" / "dqn" / "episodes.csv"
    rows = read_csv(path)
    for row in rows:
        if int(row["episode"]) < num_episodes.get(int(row["seed"]), 0):
            row["fluidity"] = ""
    write_csv(path, rows)


def test_episodes_and_seeds_without_fluidity_are_left_out(project):
    empty_fluidity(project, {SEEDS[0]: 2, SEEDS[1]: 3})
    results = load(project, PARAMS)
    fluidity = results["dqn"].quantities["fluidity"]
    assert fluidity[0] == pytest.approx(-1000 / 705)  # its last episode returned 705
    assert np.isnan(fluidity[1])
    summary = comparison.summarize(results, COMPARE)["agents"]["dqn"]
    assert summary["fluidity"]["iqm"] == pytest.approx(fluidity[[0, 2, 3]].mean())  # all of three
    assert summary["fluidity"]["worst"] == pytest.approx(fluidity[0])
    json.dumps(summary, allow_nan=False)


def test_a_quantity_that_no_seed_has_is_left_out(project):
    empty_fluidity(project, dict.fromkeys(SEEDS, 3))
    agents = summarize(project)["agents"]
    assert "fluidity" not in agents["dqn"]
    assert "fluidity" in agents["sac-long"]


def test_falls_and_failures_stand_beside_the_return(project):
    rows = [
        row | {"survived": int(row["episode"] != 0), "jumps": 10 * (1 + row["episode"])}
        for seed, value in zip(SEEDS, (100, 600, 700, 800), strict=True)
        for row in (episode_row("dqn", seed, i, value + i) for i in range(EPISODES))
    ]
    write_csv(Paths(project).agent("dqn").episodes, rows)
    found = comparison.summarize(load(project, PARAMS), COMPARE, learned=500.0)["agents"]["dqn"]
    assert found["failed"] == 1
    assert found["survivors_return"]["worst"] == 101.5
    assert found["falls_per_1000_jumps"]["mean"] == pytest.approx(1000 / 60)


def test_evaluations_are_runs_that_anybody_can_judge(project, tmp_path):
    results = load(project, PARAMS)
    write_csv(tmp_path / "curves.csv", comparison.evaluation_rows(results))
    read = runs.results(runs.from_csv(tmp_path / "curves.csv"))
    assert list(read) == list(results)
    for name, agent in read.items():
        for seed, curve in agent.curves.items():
            theirs = evaluations(results[name].curves[seed])
            np.testing.assert_array_equal(curve["env_steps"], theirs[0])
            np.testing.assert_array_equal(curve["evaluation_return_mean"], theirs[1])
