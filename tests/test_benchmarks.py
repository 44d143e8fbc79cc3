"""The benchmarks' arithmetic, processes and report; `make bench` measures."""

import json
import os
from functools import partial

import committed
import numpy as np
import pytest

from benchmarks import report
from benchmarks.__main__ import ROW_NAMES
from benchmarks.apart import apart
from benchmarks.article_ant import ArticleAnt
from benchmarks.measure import Row, compare
from benchmarks.settings import article_agent, default_world
from jumping_ant.sim.env import RobotEnv

ROW = Row("sac_vs_sb3", ours=1234.56, peer=0.012345, unit="env-steps/s", ratio=2.5, spread=0.125)
PAGE = "top\n<!-- rows -->\nold\n<!-- end of rows -->\nrest\n"
EMPTY = {"rows": [], "machine": {"cores": 2, "cpu": "X", "versions": {"torch": "2"}}}


@pytest.fixture(scope="module")
def results() -> dict:
    return json.loads(committed.text("benchmarks/results.json"))


def test_compare_takes_medians_over_pairs() -> None:
    ours, peer = iter([10.0, 12.0, 30.0]), iter([5.0, 4.0, 20.0])
    row = compare("name", "unit", partial(next, ours), partial(next, peer))
    assert row == Row("name", ours=12.0, peer=5.0, unit="unit", ratio=2.0, spread=0.75)


def test_contenders_have_processes_of_their_own() -> None:
    contender = partial(partial, os.getpid)
    with apart(contender, contender) as process_ids:
        first, second = process_ids()
        assert process_ids() == [first, second]
    assert len({first, second, os.getpid()}) == 3


def test_a_contender_that_fails_ends_the_comparison() -> None:
    with pytest.raises(ValueError, match="no number"), apart(partial(int, "no number")):
        pass


@pytest.mark.parametrize(("algorithm", "updates_per_step"), [("dqn", 1 / 4), ("sac", 1)])
def test_the_article_preset_learns_as_often_as_sb3_by_default(
    algorithm: str, updates_per_step: float
) -> None:
    agent = article_agent(algorithm)
    assert agent.gradient_steps / (agent.train_freq * agent.num_envs) == updates_per_step


def test_the_article_s_environment_is_the_project_s() -> None:
    theirs, ours = ArticleAnt(), RobotEnv(default_world())
    assert np.array_equal(theirs.reset(seed=3)[0], ours.reset(seed=3)[0])
    generator = np.random.default_rng(0)
    for _ in range(100):
        torques = generator.uniform(-1, 1, 8).astype(np.float32)
        (seen, *outcome), (expected, *expected_outcome) = theirs.step(torques), ours.step(torques)
        assert np.array_equal(seen, expected) and outcome[:3] == expected_outcome[:3]


def test_report_shows_what_was_measured() -> None:
    results = report.with_row(EMPTY, ROW, ROW_NAMES)
    filled = report.fill(PAGE, results)
    assert filled.startswith("top\n<!-- rows -->\nOn 2 cores of X, with torch 2:\n")
    assert "| `sac_vs_sb3` | 1,235 | 0.0123 | env-steps/s | **2.50** | 12% |\n<!-- end" in filled
    assert "old" not in filled and filled.endswith("<!-- end of rows -->\nrest\n")


def test_a_row_replaces_the_one_of_its_name_and_keeps_the_order() -> None:
    first = Row("dqn_vs_sb3", ours=1.0, peer=1.0, unit="env-steps/s", ratio=1.0, spread=0.0)
    results = EMPTY
    for row in (ROW, ROW, first):
        results = report.with_row(results, row, ROW_NAMES)
    assert [row["name"] for row in results["rows"]] == ["dqn_vs_sb3", "sac_vs_sb3"]


def test_committed_results_are_complete(results: dict) -> None:
    assert results.keys() == {"rows", "machine"}
    assert [row["name"] for row in results["rows"]] == list(ROW_NAMES)
    for row in results["rows"]:
        assert list(row) == ["name", "ours", "peer", "unit", "ratio", "spread"]
        assert row["ours"] > 0 and row["peer"] > 0 and row["ratio"] > 0 and row["spread"] >= 0


def test_the_committed_table_shows_the_committed_results(results: dict) -> None:
    page = report.README_PATH.read_text(encoding="utf-8")
    assert report.fill(page, results) == page
    assert all(f"| `{name}` |" in page and f"**`{name}`**" in page for name in ROW_NAMES)
