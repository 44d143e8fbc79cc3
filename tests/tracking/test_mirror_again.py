"""MLflow mirrors the files: what later calls add, replace, repair and leave."""

import shutil
import subprocess
from pathlib import Path

import pytest
from mlflow.utils.mlflow_tags import MLFLOW_MODEL_VERSIONS
from ruamel.yaml import YAML
from tracked_project import (
    AGGREGATES,
    artifact_dir,
    content,
    meaning,
    parent_name,
    query,
    runs,
    state,
    tracked,
    train,
)

from jumping_ant.base.files import write_bytes
from jumping_ant.base.paths import Paths
from jumping_ant.tracking import pages, store
from jumping_ant.tracking.mirror import track

POLICY_TAGS = ("agent", "seed", "policy_digest")
MODEL_TAGS = (*POLICY_TAGS, MLFLOW_MODEL_VERSIONS)


def test_a_changed_curve_of_all_seeds_replaces_the_run(project: Path) -> None:
    path = Paths(project).plots / "learning_curves.csv"
    path.write_text(path.read_text().replace("sac,200.0,200", "sac,200.0,201"), encoding="utf-8")
    assert "aggregates 1" in tracked(project)[0]
    assert runs(project, "sac, 2 seeds") == {"sac, 2 seeds": "FINISHED"}
    assert tracked(project)[-1].endswith("4 unchanged")


def test_a_second_call_adds_nothing(project: Path) -> None:
    before = state(project)
    assert tracked(project) == [f"MLflow at sqlite:///{project}/mlflow.db: 4 unchanged"]
    assert state(project) == before


def test_a_commit_between_calls_adds_nothing(untracked_project: Path) -> None:
    project = untracked_project

    def commit(message: str) -> str:
        settings = ["-c", "user.name=A", "-c", "user.email=a@b.c"]
        command = ["git", *settings, "commit", "--allow-empty", "-qm", message]
        subprocess.run(command, cwd=project, check=True)
        return str(store.git_commit(project))

    subprocess.run(["git", "init", "-q"], cwd=project, check=True)
    first = commit("one")
    tracked(project)
    before = state(project)
    assert commit("two") != first
    tracked(project)
    assert state(project) == before
    assert dict(content(project, "tags", "sac-seed-0"))["git_commit"] == first


def test_damage_is_repaired(untracked_project: Path) -> None:
    project = untracked_project
    tracked(project)
    before, said = state(project)[0], meaning(project)
    run_id = artifact_dir(project, "sac-seed-1").parent.name
    for table in ("metrics", "latest_metrics"):
        query(project, f"DELETE FROM {table} WHERE run_uuid = ? AND step = 300", run_id)
    query(project, "DELETE FROM params WHERE run_uuid = ? AND key = 'gamma'", run_id)
    query(project, "UPDATE runs SET status = 'RUNNING', end_time = NULL")
    (artifact_dir(project, "sac-seed-1") / "media" / "sac.mp4").unlink()
    write_bytes(artifact_dir(project, "pgpe-seed-0") / "policy.zip", b"cut off")
    for model in (project / "mlartifacts" / "models").iterdir():
        shutil.rmtree(model)
    assert tracked(project)[-1].endswith("4 repaired")
    assert meaning(project) == said
    assert state(project)[0] == before | {"latest_metrics": state(project)[0]["latest_metrics"]}


def test_a_store_of_an_older_version_is_brought_up_to_date(untracked_project: Path) -> None:
    """Such a one has neither what MLflow's pages read nor metrics or digests of models.

    Models without a digest of their files cannot be verified, and so their files are replaced.
    """
    project = untracked_project
    tracked(project)
    before, said = state(project), meaning(project)
    descriptions = query(project, "SELECT name, version, description FROM model_versions")
    pages_read = "key LIKE 'mlflow.%' AND key NOT IN ('mlflow.parentRunId', 'mlflow.runName')"
    query(project, f"DELETE FROM tags WHERE {pages_read} OR key = 'dvc_md5'")
    query(project, "DELETE FROM experiment_tags")
    query(project, "DELETE FROM logged_model_metrics")
    query(project, "DELETE FROM logged_model_tags WHERE tag_key NOT IN (?, ?, ?, ?)", *MODEL_TAGS)
    query(project, "DELETE FROM model_version_tags WHERE key NOT IN (?, ?, ?)", *POLICY_TAGS)
    query(project, "UPDATE model_versions SET description = 'old'")
    assert tracked(project)[-1].endswith("4 repaired")
    assert state(project)[0] == before[0] and state(project)[1].keys() == before[1].keys()
    assert meaning(project) == said
    assert query(project, "SELECT name, version, description FROM model_versions") == descriptions
    assert tracked(project)[-1].endswith("4 unchanged")


def test_a_description_of_the_experiment_that_someone_wrote_stays(project: Path) -> None:
    read = "SELECT value FROM experiment_tags WHERE key = 'mlflow.note.content'"
    assert pages.address("1") in query(project, read)[0][0]
    query(project, "UPDATE experiment_tags SET value = 'Mine' WHERE key = 'mlflow.note.content'")
    tracked(project)
    assert query(project, read) == [("Mine",)]


def test_a_run_that_someone_writes_stays_open(project: Path) -> None:
    opened = store.connect(project, timeout_seconds=5, max_retries=0)
    run = opened.client.create_run(opened.experiment_id, run_name="mine")
    assert tracked(project)[-1].endswith("4 unchanged")
    assert opened.client.get_run(run.info.run_id).info.status == "RUNNING"


def test_an_interrupted_call_is_completed_by_the_next(untracked_project: Path) -> None:
    project = untracked_project

    def stop(line: str) -> None:
        if line.startswith("sac seed 1"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        track(project, stop)
    tracked(project)
    assert len(runs(project)) == 5 + len(AGGREGATES)
    assert set(runs(project).values()) == {"FINISHED"}
    assert len(query(project, "SELECT * FROM model_versions")) == 4


def test_points_that_contradict_the_files_are_replaced(project: Path) -> None:
    said = meaning(project)
    run_id = artifact_dir(project, "sac-seed-0").parent.name
    query(project, "UPDATE metrics SET value = 9 WHERE run_uuid = ? AND step = 400", run_id)
    assert "sac seed 0: a run that contradicted the files was deleted" in tracked(project)
    assert meaning(project) == said


def test_the_same_policy_in_another_task_leaves_the_earlier_run_alone(project: Path) -> None:
    """As that of an agent that acts at random, whose returns depend on the task all the same."""

    def weight_and_return() -> list[tuple[str, float]]:
        sql = "SELECT p.value, m.value FROM runs r JOIN params p USING (run_uuid) "
        sql += "JOIN latest_metrics m USING (run_uuid) WHERE r.lifecycle_stage = 'active' "
        sql += "AND r.name = 'sac-seed-0' AND p.key = ? AND m.key = 'validation_return'"
        return sorted(query(project, sql, "env.reward.torso_height.weight"))

    before = weight_and_return()
    weigh_height(project, 7.0)
    for name in ("curve.csv", "validation.csv"):
        path = project / "models" / "sac" / "seed-0" / name
        text = path.read_text(encoding="utf-8").replace(",600,", ",700,")
        path.write_text(text, encoding="utf-8")
    lines = tracked(project)
    assert not any("deleted" in line for line in lines) and "4 created" in lines[-1]
    assert weight_and_return() == sorted([*before, ("7.0", 700.0)])
    assert tracked(project)[-1].endswith("4 unchanged")


def weigh_height(project: Path, weight: float) -> None:
    path = project / "params.yaml"
    settings = YAML().load(path.read_text(encoding="utf-8"))
    settings["env"]["reward"]["torso_height"]["weight"] = weight
    with path.open("w", encoding="utf-8") as file:
        YAML().dump(settings, file)


def test_retraining_makes_a_new_comparison_that_takes_over_what_it_shares(project: Path) -> None:
    old = parent_name(project, "pgpe-seed-0")
    train(project, "sac", 1, value=0.7)
    tracked(project)
    names = [row[0] for row in query(project, "SELECT name FROM runs ORDER BY start_time")]
    assert names.count("sac-seed-1") == 2
    assert parent_name(project, "pgpe-seed-0") != old
    versions = query(project, "SELECT version FROM model_versions WHERE name = 'jumping-ant-sac'")
    assert versions == [(1,), (2,), (3,)]
    aliases = query(project, "SELECT version FROM registered_model_aliases WHERE name LIKE '%sac'")
    assert aliases == [(3,)]
    train(project, "sac", 1)  # back: the newer comparison keeps what it shares
    tracked(project)
    assert parent_name(project, "pgpe-seed-0") != old


def test_a_changed_evaluation_updates_metrics_and_leaves_the_champion(project: Path) -> None:
    alias = "SELECT version FROM registered_model_aliases WHERE name = 'jumping-ant-sac'"
    assert query(project, alias) == [(2,)]
    path = project / "results" / "agents" / "sac" / "seeds.csv"
    path.write_text(path.read_text(encoding="utf-8").replace("1,115,", "1,5,"), encoding="utf-8")
    tracked(project)
    assert query(project, alias) == [(2,)], "held-out episodes choose nothing"
    latest = query(project, "SELECT value FROM latest_metrics WHERE key = 'evaluation/return'")
    of_all = [(65.0,)] * len(AGGREGATES)
    assert sorted(latest) == [(5.0,), (15.0,), (15.0,), *of_all, (115.0,)]


def test_a_policy_that_is_not_trained_leaves_the_comparison_pending(
    untracked_project: Path,
) -> None:
    project = untracked_project
    (project / "models" / "pgpe" / "seed-1" / "policy.zip").unlink()
    assert tracked(project)[0] == "not trained yet: pgpe seeds 1"
    assert parent_name(project, "sac-seed-0") == "comparison (pending)"
    assert set(runs(project).values()) == {"FINISHED"}
    train(project, "pgpe", 1)
    tracked(project)
    assert [name for name in runs(project) if "comparison" in name] == [
        parent_name(project, "sac-seed-0")
    ]
