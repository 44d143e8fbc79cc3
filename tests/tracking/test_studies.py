"""Searches for settings in MLflow."""

from pathlib import Path
from typing import Any

from mlflow import MlflowClient
from tracked_project import shown, tracked

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


def write(paths: StudyPaths, rows: list[tuple[Any, ...]], summary: dict[str, Any]) -> None:
    table = [dict(zip(outcome.COLUMNS, row, strict=True)) for row in rows]
    write_text(paths.trials, tables.to_csv(table))
    write_json(paths.summary, summary)


def mirrored(root: Path) -> list[str]:
    lines: list[str] = []
    studies.track(root, lines.append)
    return lines


def test_trials_are_nested_under_their_study(bare_project: Path) -> None:
    assert mirrored(bare_project) == []
    client = MlflowClient(f"sqlite:///{bare_project}/mlflow.db")
    assert client.get_experiment_by_name(studies.EXPERIMENT) is None, "without studies"
    write(Paths(bare_project).study("sac"), ROWS, SUMMARY)
    assert mirrored(bare_project) == ["study sac-tpe-1234: 4 trials, 4 new"]
    found = shown(bare_project)
    study = found.pop("sac-tpe-1234")
    assert found.keys() == {f"trial {number}" for number in range(4)}
    assert {run.tags["mlflow.parentRunId"] for run in found.values()} == {study.id}
    best = found["trial 3"]
    assert best.params == {"gamma": "0.95", "net_arch": "[64, 64]"}
    assert {name: value for name, _, value in best.metrics} == {
        **{"value": 7400, "return/seed_1": 7400, "return/seed_2": 7420},
        **{"seconds/seed_1": 50, "seconds/seed_2": 51},
    }
    assert best.status == "FINISHED" and found["trial 1"].status == "KILLED"
    assert found["trial 2"].tags["reason"] == "refused: n_top is 9"
    assert found["trial 2"].metrics == []
    assert {("p", 0, 0.01), ("importance/gamma", 0, 0.7)} <= set(study.metrics)
    curve = [point[1:] for point in study.metrics if point[0] == studies.BEST]
    assert curve == [(0, 7000), (3, 7400)]
    assert "after" not in {name for name, *_ in study.metrics}, "which is not known"
    assert study.files == {"sac.csv", "sac.json"}
    assert study.tags["mlflow.note.content"].endswith("**better**. Much.")


def test_new_trials_are_added_and_a_second_call_adds_nothing(bare_project: Path) -> None:
    """As of a control, which has no verdict; the pipeline mirrors studies, too."""
    control = SUMMARY | {"sampler": "random", "study": "sac-random-1234"}
    del control["verdict"], control["evidence"]
    paths = Paths(bare_project).study("sac", is_control=True)
    write(paths, ROWS[:2], control)
    assert "study sac-random-1234: 2 trials, 2 new" in tracked(bare_project)
    before = shown(bare_project)
    assert mirrored(bare_project) == []
    write(paths, ROWS, control)
    assert mirrored(bare_project) == ["study sac-random-1234: 4 trials, 2 new"]
    after = shown(bare_project)
    assert before.keys() < after.keys() and len(after) == 5
    study = after["sac-random-1234"]
    parents = [run.tags.get("mlflow.parentRunId", study.id) for run in after.values()]
    assert parents == [study.id] * 5 and before["trial 0"].id == after["trial 0"].id
    assert study.params["sampler"] == "random"
    assert study.tags["mlflow.note.content"] == "Search for settings of sac."
