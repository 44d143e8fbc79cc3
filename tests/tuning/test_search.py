"""Searches with a small agent: killed and resumed, shared, judged."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import pandas as pd
import pytest
from small_study import RANGES, project, small_params, small_settings

from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.params import params_file, presets
from jumping_ant.tuning import search, space, tune
from jumping_ant.tuning.task import Task
from scripts import tune as command

Rows = list[dict[str, str]]


@pytest.fixture(autouse=True)
def small_and_quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(space.RANGES, "pgpe", RANGES)
    monkeypatch.setattr(search, "HEARTBEAT", 1)
    monkeypatch.setattr(search, "GRACE", 2)


def run(
    root: Path, trials: int, sampler: search.SamplerName = "tpe", workers: int = 1, **more: Any
) -> tuple[Rows, dict[str, Any]]:
    params, settings = small_params(workers), small_settings(trials, **more)
    tune.run(root, params, "pgpe", settings, sampler, say=lambda _: None)
    return outcome(root, is_control=sampler == "random")


def outcome(root: Path, is_control: bool = False) -> tuple[Rows, dict[str, Any]]:
    paths = Paths(root).study("pgpe", is_control)
    table = pd.read_csv(paths.trials, dtype=str, keep_default_na=False).to_dict("records")
    summary = json.loads(paths.summary.read_text("utf-8"))
    return [row | {"seconds": ""} for row in table], summary | {"seconds": {}}


def start(root: Path, trials: int, *storage: str) -> "subprocess.Popen[str]":
    script = str(Path(__file__).with_name("small_study.py"))
    words = [sys.executable, script, str(root), str(trials), *storage]
    return subprocess.Popen(words, stdout=subprocess.PIPE, encoding="utf-8")


def wait_for(driver: "subprocess.Popen[str]", line: str) -> None:
    assert driver.stdout
    while not driver.stdout.readline().startswith(line):
        assert driver.poll() is None


def states(database: Path) -> list[str]:
    (name,) = optuna.get_all_study_names(f"sqlite:///{database}")
    study = optuna.load_study(study_name=name, storage=f"sqlite:///{database}")
    return [trial.state.name for trial in study.trials]


def test_the_same_command_gives_the_same_trials(tmp_path: Path) -> None:
    first, second = (run(project(tmp_path / name), 12) for name in "ab")
    assert first[0] == second[0] and len({row["settings"] for row in first[0]}) == 12
    assert first[0][0]["settings"] == "{}", "those of the agent come first"
    assert (first[1]["verdict"], first[1]["p"]) == (second[1]["verdict"], second[1]["p"])
    drawn, control = run(tmp_path / "a", 12, "random", workers=2)  # whose draws are the same
    assert [row["settings"] for row in drawn[:10]] == [row["settings"] for row in first[0][:10]]
    assert drawn[11]["settings"] != first[0][11]["settings"] and "verdict" not in control
    assert control["expected_best"]["1"] == pytest.approx(np.mean(control["draws"]))


def test_a_killed_search_resumes_and_trains_nothing_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trained: list[tuple[Any, int]] = []
    measure = Task.measure

    def counted(self: Task, agent: Any, seed: int, *rest: Any) -> Any:
        for note in measure(self, agent, seed, *rest):
            trained.append((repr(agent), seed))
            yield note

    root = project(tmp_path)
    database = Paths(root).study("pgpe").study
    with start(root, 6) as driver:
        wait_for(driver, "trial 2")
        os.kill(driver.pid, signal.SIGKILL)
    monkeypatch.setattr(Task, "measure", counted)
    before = states(database)
    table, summary = run(root, 6)
    after = states(database)
    assert before.count("RUNNING") <= 1 and set(after) <= {"COMPLETE", "PRUNED", "FAIL"}
    assert after.count("FAIL") == before.count("RUNNING")
    assert len({row["settings"] for row in table}) == len(table) == summary["trials"] == 6
    assert len(trained) == len(set(trained)) <= 2 * 3 + 4, "three trials, and the verdict"
    trained.clear()
    assert run(root, 6) == (table, summary) and not trained
    whole, _ = run(project(tmp_path / "whole"), 6)
    names = ("value", "settings")
    assert [[row[name] for name in names] for row in table] == [
        [row[name] for name in names] for row in whole
    ]


def test_processes_share_a_search(tmp_path: Path) -> None:
    """One is stopped in a trial, which the other finishes; both write the same outcome."""
    storage, roots = f"sqlite:///{tmp_path}/shared.db", [project(tmp_path / name) for name in "abc"]
    with start(roots[0], 40, storage) as first:
        wait_for(first, "pgpe: study")
        with start(roots[1], 40, storage) as stopped, start(roots[2], 40, storage) as third:
            wait_for(stopped, "trial")
            stopped.send_signal(signal.SIGTERM)
            assert stopped.wait(60) == 130
            assert first.wait(120) == third.wait(120) == 0
    outcomes = [outcome(root) for root in (roots[0], roots[2])]
    assert outcomes[0] == outcomes[1] and len(outcomes[0][0]) == 40
    assert set(states(tmp_path / "shared.db")) <= {"COMPLETE", "PRUNED", "FAIL"}


def trained(monkeypatch: pytest.MonkeyPatch, gain: float, seconds: float = 10.0) -> None:
    """Have trainings return what a formula says: `gain` more with other settings."""

    def measure(self: Any, agent: Any, seed: int, starts: range, *_: Any) -> Any:
        is_other = agent.stdev_init != self.space.agent.stdev_init
        noise = np.random.default_rng([seed, is_other]).normal(0, 10)
        returns = [1000 + noise + is_other * gain * min(1, agent.stdev_init)] * len(starts)
        end = (seconds if is_other else 10.0) + noise / 100
        note = {"returns": returns, "return": returns[0], "seconds": 12.0, "onset": [end - 1, end]}
        yield {"fault": "not finite"} if is_other and gain < -900 else note

    monkeypatch.setattr(Task, "measure", measure)


def test_better_settings_become_a_preset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root, paths = project(tmp_path), Paths(tmp_path).study("pgpe")
    trained(monkeypatch, gain=3000)
    table, summary = run(root, 12, fresh_seeds=8, episodes=10)
    assert summary["verdict"] == "better" and summary["p"] < 0.001
    assert summary["low"] <= summary["difference"] <= summary["high"]
    assert "less than trial" in {row["reason"][:15] for row in table}
    tuned = presets.load(paths.preset.name, root).agents["pgpe"].model_dump()
    before = params_file.load(root / "params.yaml").agents["pgpe"].model_dump()
    assert {key: own for key, own in tuned.items() if own != before[key]} == summary["settings"]
    trained(monkeypatch, gain=-500)
    _, summary = run(root, 12, spread_penalty=0.0)
    assert (summary["verdict"], summary["settings"], summary["p"]) == ("unchanged", {}, None)
    assert not paths.preset.exists(), "which an earlier study wrote"
    trained(monkeypatch, gain=0, seconds=5.0)
    _, summary = run(root, 12, target_return=500.0, fresh_seeds=8)
    assert summary["verdict"] == "better" and summary["difference"] == pytest.approx(5, abs=0.5)
    trained(monkeypatch, gain=-1000)
    table, summary = run(root, 12, spread_penalty=0.1)
    assert (summary["verdict"], summary["without_value"]) == ("unchanged", 11)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["sac", "--trials=0"], "--trials: given '0': Input should be greater than or equal to 1"),
        (["sac", "--target-return=much"], "--target-return: given 'much': "),
        (["sac", "--sampler=grid"], "--sampler: invalid choice: 'grid'"),
        (["random"], "agent: given 'random', allowed: those of dqn, decqn"),
        (["nobody"], "nobody"),
        (["pgpe", "--storage=me:sec@ret"], "storage: given no address: "),
        (["pgpe", "--storage=oracle+oracledb://me:sec@ret@host"], "oracle+oracledb://host: "),
        (["pgpe", "--storage=sqlite:////dev/null/a.db"], "storage: given sqlite:////dev/null/a.db"),
    ],
)
def test_bad_arguments(
    words: list[str],
    message: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("sys.argv", ["tune", *words])
    with pytest.raises((SystemExit, InputError)) as caught:
        command.main()
    shown = f"{caught.value} {capsys.readouterr().err}"
    assert message in shown and "ret@" not in shown
