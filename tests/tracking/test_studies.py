"""Searches for settings in MLflow."""

from pathlib import Path
from typing import Any

import pytest
from mlflow import MlflowClient
from mlflow.entities import Run
from tracked_project import make_bare, tracked, unset_variables

from jumping_ant.base import tables
from jumping_ant.base.files import write_json, write_text
from jumping_ant.base.paths import Paths, StudyPaths
from jumping_ant.tracking import studies
from jumping_ant.tuning import outcome

ROWS = [
    (0, "complete", "7000", "6900 7100", "48 49", "", "{}"),
    (1, "pruned", "5000", "5000", "30", "less than trial 0", '{"gamma": 0.9}'),
    (2, "pruned", "", "", "", "refused: n_top is 9", '{"gamma": 0.8}'),
    (3, "complete", "7400", "7400 7420", "50 51", "", '{"gamma": 0.95, "net_arch": [64, 64]}'),
]
SUMMARY = {
    "agent": "sac",
    "sampler": "tpe",
    "study": "sac-tpe-1234",
    "trials": 4,
    "pruned": 2,
    "best_value": 7400.0,
    "importance": {"gamma": 0.7, "net_arch": 0.3},
    "verdict": "better",
    "evidence": "Much.",
    "before": 7000.0,
    "after": None,
    "p": 0.01,
}


@pytest.fixture
def root(tmp_path: Path, empty_database: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    unset_variables(monkeypatch)
    make_bare(tmp_path / "project", empty_database)
    return tmp_path / "project"


def write(paths: StudyPaths, rows: list[tuple[Any, ...]], summary: dict[str, Any]) -> None:
    table = [dict(zip(outcome.COLUMNS, row, strict=True)) for row in rows]
    write_text(paths.trials, tables.to_csv(table))
    write_json(paths.summary, summary)


def told(root: Path) -> list[str]:
    said: list[str] = []
    studies.track(root, said.append)
    return said


def runs(root: Path) -> dict[str, Run]:
    client = MlflowClient(f"sqlite:///{root}/mlflow.db")
    experiment = client.get_experiment_by_name(studies.EXPERIMENT)
    assert experiment
    found = client.search_runs([experiment.experiment_id])
    by_name = {run.info.run_name: run for run in found}
    assert len(by_name) == len(found), "no run is there twice"
    return by_name


def test_trials_are_nested_under_their_study(root: Path) -> None:
    write(Paths(root).study("sac"), ROWS, SUMMARY)
    assert told(root) == ["study sac-tpe-1234: 4 trials, 4 new"]
    found = runs(root)
    study = found.pop("sac-tpe-1234")
    assert found.keys() == {f"trial {number}" for number in range(4)}
    assert {run.data.tags["mlflow.parentRunId"] for run in found.values()} == {study.info.run_id}
    best = found["trial 3"]
    assert best.data.params == {"gamma": "0.95", "net_arch": "[64, 64]"}
    assert best.data.metrics == {
        **{"value": 7400, "return/seed_1": 7400, "return/seed_2": 7420},
        **{"seconds/seed_1": 50, "seconds/seed_2": 51},
    }
    assert best.info.status == "FINISHED" and found["trial 1"].info.status == "KILLED"
    assert found["trial 2"].data.tags["reason"] == "refused: n_top is 9"
    assert "value" not in found["trial 2"].data.metrics
    assert study.data.metrics["p"] == 0.01 and study.data.metrics["importance/gamma"] == 0.7
    assert "after" not in study.data.metrics
    client = MlflowClient(f"sqlite:///{root}/mlflow.db")
    history = client.get_metric_history(study.info.run_id, studies.BEST)
    assert [(point.step, point.value) for point in history] == [(0, 7000), (3, 7400)]
    files = [file.path for file in client.list_artifacts(study.info.run_id)]
    assert sorted(files) == ["sac.csv", "sac.json"]
    assert study.data.tags["mlflow.note.content"].endswith("**better**. Much.")


def test_a_second_call_changes_nothing_and_new_trials_are_added(root: Path) -> None:
    write(Paths(root).study("sac"), ROWS[:2], SUMMARY)
    told(root)
    before = runs(root)
    assert told(root) == []
    write(Paths(root).study("sac"), ROWS, SUMMARY)
    assert told(root) == ["study sac-tpe-1234: 4 trials, 2 new"]
    after = runs(root)
    assert before.keys() < after.keys() and len(after) == 5
    study = after["sac-tpe-1234"].info.run_id
    assert [run.data.tags.get("mlflow.parentRunId", study) for run in after.values()] == [study] * 5
    assert before["trial 0"].info.run_id == after["trial 0"].info.run_id


def test_a_control_is_a_study_without_a_verdict(root: Path) -> None:
    """The pipeline mirrors it, too."""
    own = {key: value for key, value in SUMMARY.items() if key not in ("verdict", "evidence")}
    control = own | {"sampler": "random", "study": "sac-random-1234"}
    write(Paths(root).study("sac", is_control=True), ROWS[:2], control)
    assert "study sac-random-1234: 2 trials, 2 new" in tracked(root)
    assert told(root) == []
    study = runs(root)["sac-random-1234"]
    assert study.data.params["sampler"] == "random"
    assert study.data.tags["mlflow.note.content"] == "Search for settings of sac."


def test_a_project_without_studies_has_no_experiment_for_them(root: Path) -> None:
    assert told(root) == []
    client = MlflowClient(f"sqlite:///{root}/mlflow.db")
    assert client.get_experiment_by_name(studies.EXPERIMENT) is None
