"""MLflow mirrors the files: real stores, damaged and repaired."""

import hashlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from mlflow.utils.mlflow_tags import MLFLOW_MODEL_VERSIONS
from ruamel.yaml import YAML
from tracked_project import (
    AGENTS,
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

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT, digest, write_bytes, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import params_file
from jumping_ant.tracking import connection, models, pages, reading, records, store
from jumping_ant.tracking.mirror import track

POLICY_TAGS = ("agent", "seed", "policy_digest")


MODEL_TAGS = (*POLICY_TAGS, MLFLOW_MODEL_VERSIONS)


def test_a_run_shows_the_files_of_its_seed(project: Path) -> None:
    comparison = next(name for name in runs(project) if name.startswith("comparison"))
    seeds = ["sac-seed-0", "sac-seed-1", "pgpe-seed-0", "pgpe-seed-1"]
    assert runs(project) == dict.fromkeys([comparison, *seeds, *AGGREGATES], "FINISHED")
    metrics = content(project, "metrics", "sac-seed-1")
    assert [row for row in metrics if row[0] == "return_mean"] == [
        ("return_mean", 200, 201.0),
        ("return_mean", 300, 301.0),
        ("return_mean", 400, 401.0),
    ]
    assert ("evaluation_return_mean", 300, 601.0) in metrics
    assert ("evaluation/return", 0, 115.0) in metrics
    assert ("train_seconds", 0, 40.0) in metrics
    assert ("validation_return", 0, 601.0) in metrics
    assert ("final_return", 0, 51.0) in metrics
    assert len(metrics) == 4 * 3 + 3 + 1 + 3 + 3, "fluidity, which no seed has, is left out"
    params = dict(content(project, "params", "sac-seed-1"))
    settings = params_file.load(project / "params.yaml")
    assert params["learning_rate"] == str(settings.agent("sac").learning_rate)
    assert params["env.reward.torso_height.span"] == str(settings.env.reward.torso_height.span)
    assert params["robot"] == "edited" and params["robot.mass"] == "0.44"
    tags = dict(content(project, "tags", "sac-seed-1"))
    policy_path = project / "models" / "sac" / "seed-1" / "policy.zip"
    assert tags["policy_digest"] == digest(policy_path)
    assert (tags["agent"], tags["seed"], tags["algorithm"]) == ("sac", "1", "sac")
    assert tags["dvc_stage"] == "train@sac"
    files = artifact_dir(project, "sac-seed-1")
    assert (files / "policy.zip").read_bytes() == policy_path.read_bytes()
    assert json.loads((files / "machines.json").read_text(encoding="utf-8"))["1"] == {"cpu": "a"}
    assert (files / "media" / "sac.mp4").read_bytes() == b"video of sac"
    assert not (artifact_dir(project, "sac-seed-0") / "media").exists()
    assert parent_name(project, "sac-seed-1") == comparison


def test_the_comparison_shows_its_headline_and_all_media(project: Path) -> None:
    comparison = next(name for name in runs(project) if name.startswith("comparison"))
    metrics = content(project, "metrics", comparison)
    assert ("sac/return_iqm", 0, 65.0) in metrics
    assert ("pgpe/env_steps", 0, 400.0) in metrics
    assert ("pgpe/train_seconds", 0, 40.0) in metrics
    assert ("pgpe/return_at_equal_seconds_iqm", 0, 60.0) in metrics
    assert ("probability_of_improvement/sac_over_pgpe", 0, 0.75) in metrics
    files = artifact_dir(project, comparison)
    names = {str(path.relative_to(files)) for path in files.rglob("*") if path.is_file()}
    assert names == {
        "params.yaml",
        "robot.json",
        "comparison.json",
        "speed.json",
        "results/report.html",
        "results/speed.html",
        "figures/curves.png",
        "speed/curves.png",
        *(f"media/{agent}.{kind}" for agent in AGENTS for kind in ("mp4", "rrd")),
    }
    note = dict(content(project, "tags", comparison))[pages.NOTE]
    assert "**inconclusive** (adjusted p = 0.75): SAC leads" in note
    assert "**supported** (adjusted p = 0.01): PGPE is slow" in note


def test_all_seeds_of_an_agent_are_a_run_too(project: Path) -> None:
    """With the interquartile mean and its interval at each step, under the comparison."""
    (parent,) = runs(project, "comparison-%")
    for name in AGGREGATES:
        assert runs(project, name) == {name: "FINISHED"}
        assert parent_name(project, name) == parent
        points = query(
            project,
            "SELECT key, step, value FROM metrics JOIN runs USING (run_uuid) "
            "WHERE name = ? AND key LIKE 'return_%' ORDER BY key, step",
            name,
        )
        assert points == [
            ("return_high", 200, 205), ("return_high", 400, 405),
            ("return_iqm", 200, 200), ("return_iqm", 400, 400),
            ("return_low", 200, 195), ("return_low", 400, 395),
        ]  # fmt: skip
        metrics = query(
            project,
            "SELECT key, value FROM latest_metrics JOIN runs USING (run_uuid) WHERE name = ?",
            name,
        )
        assert {("evaluation/return", 65.0), ("evaluation/return_worst", 15.0)} <= set(metrics)


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


def test_the_last_line_tells_where_to_look(project: Path) -> None:
    lines: list[str] = []
    track(project, lines.append, "http://127.0.0.1:5000/")
    assert lines[-1] == f"Look at http://127.0.0.1:5000/{pages.address('1')}"


def test_runs_and_models_lead_back_to_the_policy_file(project: Path) -> None:
    policy = project / "models" / "sac" / "seed-1" / "policy.zip"
    md5 = hashlib.md5(policy.read_bytes()).hexdigest()
    assert dict(content(project, "tags", "sac-seed-1"))["dvc_md5"] == md5
    version = query(
        project,
        "SELECT description FROM model_versions WHERE name = 'jumping-ant-sac' AND version = 2",
    )[0][0]
    assert version.startswith(
        "sac, training seed 1: mean return 115 on the held-out episodes, 601 in validation, "
        "apex of its jumps 2.5 m, share of time in flight 0.25. "
        "Each output is held for 1 control step."
    )
    assert md5 in version and digest(policy) in version and "train@sac" in version
    metrics = query(
        project,
        "SELECT metric_name, metric_value FROM logged_model_metrics m JOIN logged_models l "
        "ON l.model_id = m.model_id WHERE l.name = 'sac-seed-1'",
    )
    assert dict(metrics) == {
        "evaluation/return": 115.0,
        "evaluation/apex": 2.5,
        "evaluation/flight": 0.25,
        "validation_return": 601.0,
        "final_return": 51.0,
        "train_seconds": 40.0,
    }


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


def test_the_best_in_validation_is_champion(untracked_project: Path) -> None:
    path = untracked_project / "models" / "sac" / "seed-0" / "validation.csv"
    path.write_text(path.read_text(encoding="utf-8").replace(",600,", ",700,"), encoding="utf-8")
    tracked(untracked_project)
    aliases = "SELECT name, version FROM registered_model_aliases ORDER BY name"
    assert query(untracked_project, aliases) == [("jumping-ant-pgpe", 2), ("jumping-ant-sac", 1)]


def test_validation_is_of_the_policy_that_was_published(untracked_project: Path) -> None:
    """Of the finalists it is the best; one trained before there were finalists has none."""
    paths = Paths(untracked_project).agent("sac").seed(0)
    with paths.validation.open("a", encoding="utf-8") as file:
        file.write("sac,0,400,20,650,1.5\n")
    params = params_file.load(untracked_project / "params.yaml")
    assert records.read(untracked_project, params).seeds[0].validation_return == 650.0
    paths.validation.unlink()
    assert records.read(untracked_project, params).seeds[0].validation_return is None


def test_models_say_how_long_to_hold_an_output(project: Path) -> None:
    tags = query(project, "SELECT value FROM model_version_tags WHERE key = 'hold'")
    assert tags == [("1",)] * 4
    about = query(project, "SELECT DISTINCT description FROM registered_models")
    assert about == [(models.ABOUT,)] and "tag `hold`" in models.ABOUT


def test_the_unedited_robot_has_no_edits(untracked_project: Path) -> None:
    facts = {"before": {"mass": 0.88}, "after": {"mass": 0.44}}
    write_text(untracked_project / "assets" / "robot.json", json.dumps(facts))
    params = params_file.load(untracked_project / "params.yaml")
    block = params.agent("sac").model_copy(update={"robot": "unedited"})
    plain = params.model_copy(update={"agents": {"sac": block}})
    own = records.run_params(untracked_project, plain, "sac")
    robot = {name: value for name, value in own.items() if name.startswith("robot")}
    assert robot == {"robot": "unedited", "robot.source": "ant", "robot.mass": "0.88"}


def test_what_is_not_finite_is_not_logged(untracked_project: Path) -> None:
    agents = {"sac": {"seeds": 2, "fluidity": {"iqm": float("nan"), "mean": -2.5}}}
    write_text(Paths(untracked_project).comparison, json.dumps({"agents": agents}))
    Paths(untracked_project).speed.unlink()
    params = params_file.load(untracked_project / "params.yaml")
    summary = records.read(untracked_project, params).summary
    assert summary == {"sac/seeds": 2.0, "sac/fluidity_mean": -2.5}


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


def test_the_stage_depends_on_all_that_it_reads(project: Path) -> None:
    opened: set[Path] = set()
    noted = [opened]  # no hook can be removed

    def note(event: str, arguments: tuple[object, ...]) -> None:
        if event == "open" and isinstance(arguments[0], str | Path):
            for files in noted:
                files.add(Path(arguments[0]))

    sys.addaudithook(note)
    tracked(project)
    noted.clear()
    stage = YAML(typ="safe").load((PROJECT_ROOT / "dvc.yaml").read_text("utf-8"))["stages"]["track"]
    read = {str(path.relative_to(project)) for path in opened if path.is_relative_to(project)}
    own = ("params.yaml", "mlflow.db", "mlartifacts/")
    undeclared = [name for name in read if not name.startswith((*own, *stage["deps"]))]
    assert undeclared == [] and "results/plots/learning_curves.csv" in read


def test_nothing_trained_is_no_error(bare_project: Path) -> None:
    assert tracked(bare_project)[-1].endswith("nothing to show")
    assert runs(bare_project) == {}


def test_the_uri_is_the_variable_or_the_project(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    assert connection.tracking_uri(tmp_path) == f"sqlite:///{tmp_path}/mlflow.db"
    temporary = tmp_path / ".dvc" / "tmp" / "exps" / "standalone" / "tmpx"
    assert connection.tracking_uri(temporary) == f"sqlite:///{tmp_path}/mlflow.db"
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://here:1")
    assert connection.tracking_uri(tmp_path) == "http://here:1"


def test_a_moved_project_is_told_so(project: Path) -> None:
    moved = project.with_name("moved")
    shutil.copytree(project, moved)
    with pytest.raises(InputError, match=r"was moved: delete mlflow\.db"):
        tracked(moved)


def test_a_damaged_database_is_told_in_one_line(project: Path) -> None:
    (project / "mlflow.db").write_bytes(b"not a database" * 100)
    with pytest.raises(InputError, match="not a database") as caught:
        tracked(project)
    assert "\n" not in str(caught.value)


def test_a_damaged_curve_is_told_by_file(tmp_path: Path) -> None:
    path = Paths(tmp_path).agent("sac").seed(7).curve
    write_text(path, "agent,seed,env_steps,loss\nsac,7,100,much\n")
    with pytest.raises(InputError, match=r"curve\.csv: row 1, column loss: given 'much'"):
        reading.read_curve(tmp_path, "sac", 7)
    write_text(path, "agent,seed,env_steps,loss,other\nsac,7,100,,\nsac,7,200,1.5,\nsac,7,300,2")
    assert reading.read_curve(tmp_path, "sac", 7) == {("loss", 200): 1.5}
    write_text(path, "agent,seed,env_steps,loss,other\nsac,7,200,1.5,\nsac,7,200,,3\n")
    both = {("loss", 200): 1.5, ("other", 200): 3.0}  # a row of training, and one of an evaluation
    assert reading.read_curve(tmp_path, "sac", 7) == both
    with pytest.raises(InputError, match="given one of agent sac, seed 7, allowed: rows of agent"):
        shutil.copytree(path.parent, path.parent.with_name("seed-8"))
        reading.read_curve(tmp_path, "sac", 8)


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("results/agents/{}/trajectory.npz", "given an episode of agent 'pgpe', allowed: 'sac'"),
        ("results/timing/{}/timing.csv", "given one of agent pgpe, allowed: rows of agent sac"),
        ("results/agents/{}/seeds.csv", "given one of agent pgpe, allowed: rows of agent sac"),
        ("results/agents/{}/variants.csv", "given one of agent pgpe, allowed: rows of agent sac"),
        ("models/{}/seed-0/curve.csv", "given one of agent pgpe, seed 0, allowed: rows of agent"),
    ],
)
def test_files_of_another_agent_are_not_mirrored(
    untracked_project: Path, place: str, said: str
) -> None:
    one, other = (untracked_project / place.format(agent) for agent in ("sac", "pgpe"))
    shutil.copy(other, one)
    with pytest.raises(InputError, match=said) as caught:
        tracked(untracked_project)
    assert str(one) in str(caught.value)
