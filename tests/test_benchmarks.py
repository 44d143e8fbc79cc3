"""The benchmarks' arithmetic, processes, memory and report; `make bench` measures."""

import json
import os
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import committed
import numpy as np
import pytest

import benchmarks.__main__ as benchmark
import soak.__main__ as soaking
from benchmarks import memory, report
from benchmarks.__main__ import ROW_NAMES
from benchmarks.article_ant import ArticleAnt, default_world
from benchmarks.measure import Row, apart, compare
from jumping_ant.sim.env import RobotEnv

ROW = Row("sac_vs_sb3", ours=1234.56, peer=0.012345, unit="env-steps/s", ratio=2.5, spread=0.125)
PAGE = "top\n<!-- rows -->\nold\n<!-- end of rows -->\nrest\n"
HOLD = "import os, time; held = b'x' * 2**28; {}; time.sleep(1)"
CHILD = f"subprocess.run([sys.executable, '-c', {HOLD.format('pass')!r}], env={{}})"


def test_compare_takes_medians_over_pairs() -> None:
    ours, peer = iter([10.0, 12.0, 30.0]), iter([5.0, 4.0, 20.0])
    row = compare("name", "unit", partial(next, ours), partial(next, peer))
    assert row == Row("name", ours=12.0, peer=5.0, unit="unit", ratio=2.0, spread=0.75)


@pytest.mark.parametrize(("module", "begins"), [(benchmark, "report"), (soaking, "checkout")])
def test_rows_and_parts_may_be_named(
    monkeypatch: pytest.MonkeyPatch, module: Any, begins: str
) -> None:
    begun = Mock(side_effect=InterruptedError, **{"load.side_effect": InterruptedError})
    monkeypatch.setattr(module, begins, begun)
    for names, end in (([], InterruptedError), (["typo"], SystemExit)):
        monkeypatch.setattr(sys, "argv", ["command", *names])
        with pytest.raises(end):
            module.main()


def test_contenders_have_processes_of_their_own() -> None:
    contender = partial(partial, os.getpid)
    with apart(contender, contender) as process_ids:
        first, second = process_ids()
        assert process_ids() == [first, second]
    assert len({first, second, os.getpid()}) == 3


@pytest.mark.parametrize(
    "code",
    [HOLD.format("os.fork()"), f"import subprocess, sys; {CHILD}"],
    ids=["pages shared by two", "a child without variables"],
)
def test_memory_is_of_all_processes(
    code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory, "SECONDS_BETWEEN_SAMPLES", 0.2)
    assert 0.25 < memory.peak([sys.executable, "-c", code], tmp_path, os.environ) < 0.3


def test_the_article_s_environment_is_the_project_s() -> None:
    theirs, ours = ArticleAnt(), RobotEnv(default_world())
    assert np.array_equal(theirs.reset(seed=3)[0], ours.reset(seed=3)[0])
    generator = np.random.default_rng(0)
    for _ in range(100):
        torques = generator.uniform(-1, 1, 8).astype(np.float32)
        (seen, *outcome), (expected, *expected_outcome) = theirs.step(torques), ours.step(torques)
        assert np.array_equal(seen, expected) and outcome[:3] == expected_outcome[:3]


def test_the_report_shows_each_row_once_and_in_order() -> None:
    results: dict = {"rows": [], "machine": {"cores": 2, "cpu": "X", "versions": {"torch": "2"}}}
    for row in (ROW, ROW, replace(ROW, name="dqn_vs_sb3")):
        results = report.with_row(results, row, ROW_NAMES)
    filled = report.fill(PAGE, results)
    assert [row["name"] for row in results["rows"]] == ["dqn_vs_sb3", "sac_vs_sb3"]
    last = "| `sac_vs_sb3` | 1,235 | 0.0123 | env-steps/s | **2.50** | 12% |"
    assert filled.startswith("top\n<!-- rows -->\nOn 2 cores of X, with torch 2:\n")
    assert filled.endswith(f"{last}\n<!-- end of rows -->\nrest\n") and "old" not in filled


def test_the_committed_table_shows_the_committed_results_of_all_rows() -> None:
    results = json.loads(committed.text("benchmarks/results.json"))
    assert [row["name"] for row in results["rows"]] == list(ROW_NAMES)
    page = report.README_PATH.read_text(encoding="utf-8")
    assert report.fill(page, results) == page
    assert all(f"**`{name}`**" in page for name in ROW_NAMES), "a row is not explained"
