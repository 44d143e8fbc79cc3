"""MLflow mirrors the files: what runs, models and the comparison show."""

import hashlib
import json
import shutil
import sys
from pathlib import Path

import pytest
from ruamel.yaml import YAML
from tracked_project import (
    AGENTS,
    AGGREGATES,
    artifact_dir,
    content,
    parent_name,
    query,
    runs,
    tracked,
)

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT, digest, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.params import params_file
from jumping_ant.tracking import connection, models, pages, records


def test_a_run_shows_the_files_of_its_seed(project: Path) -> None:
    comparison = next(name for name in runs(project) if name.startswith("comparison"))
    seeds = ["sac-seed-0", "sac-seed-1", "pgpe-seed-0", "pgpe-seed-1"]
    assert runs(project) == dict.fromkeys([comparison, *seeds, *AGGREGATES], "FINISHED")
    metrics = content(project, "metrics", "sac-seed-1")
    returns = [(step, value) for name, step, value in metrics if name == "return_mean"]
    assert returns == [(200, 201.0), (300, 301.0), (400, 401.0)]
    assert {
        ("evaluation_return_mean", 300, 601.0),
        ("evaluation/return", 0, 115.0),
        ("train_seconds", 0, 40.0),
        ("validation_return", 0, 601.0),
        ("final_return", 0, 51.0),
    } <= set(metrics)
    assert len(metrics) == 4 * 3 + 3 + 1 + 3 + 3, "fluidity, which no seed has, is left out"
    params = dict(content(project, "params", "sac-seed-1"))
    settings = params_file.load(project / "params.yaml")
    assert params["learning_rate"] == str(settings.agent("sac").learning_rate)
    assert params["env.reward.torso_height.span"] == str(settings.env.reward.torso_height.span)
    assert params["robot"] == "edited" and params["robot.mass"] == "0.44"
    tags = dict(content(project, "tags", "sac-seed-1"))
    policy = Paths(project).agent("sac").seed(1).policy
    md5 = hashlib.md5(policy.read_bytes()).hexdigest()
    known = {"agent": "sac", "seed": "1", "algorithm": "sac", "dvc_stage": "train@sac"}
    assert tags.items() >= (known | {"policy_digest": digest(policy), "dvc_md5": md5}).items()
    files = artifact_dir(project, "sac-seed-1")
    assert (files / "policy.zip").read_bytes() == policy.read_bytes()
    assert (files / "machines.json").is_file()
    assert (files / "media" / "sac.mp4").read_bytes() == b"video of sac"
    assert not (artifact_dir(project, "sac-seed-0") / "media").exists()
    assert parent_name(project, "sac-seed-1") == comparison


def test_files_may_be_links_into_a_cache(untracked_project: Path) -> None:
    """As with DVC's `cache.type symlink`."""
    cache = untracked_project.parent / "cache"
    cache.mkdir()
    outputs = [untracked_project / name for name in ("models", "media", "results")]
    files = [path for folder in outputs for path in folder.rglob("*") if path.is_file()]
    for number, path in enumerate(files):
        path.rename(cache / str(number))
        path.symlink_to(cache / str(number))
    tracked(untracked_project)
    stored = (untracked_project / "mlartifacts").rglob("artifacts/policy.zip")
    trained = (untracked_project / "models").rglob("policy.zip")
    assert {digest(path) for path in stored if not path.is_symlink()} == set(map(digest, trained))


def test_the_comparison_shows_its_headline_and_all_media(project: Path) -> None:
    comparison = next(name for name in runs(project) if name.startswith("comparison"))
    assert {
        ("sac/return_iqm", 0, 65.0),
        ("pgpe/env_steps", 0, 400.0),
        ("pgpe/train_seconds", 0, 40.0),
        ("pgpe/return_at_equal_seconds_iqm", 0, 60.0),
        ("probability_of_improvement/sac_over_pgpe", 0, 0.75),
    } <= set(content(project, "metrics", comparison))
    files = artifact_dir(project, comparison)
    names = {str(path.relative_to(files)) for path in files.rglob("*") if path.is_file()}
    assert names == {
        *("params.yaml", "robot.json", "comparison.json", "speed.json", "results/report.html"),
        "figures/curves.png",
        *(f"media/{agent}.{kind}" for agent in AGENTS for kind in ("mp4", "rrd")),
    }
    note = dict(content(project, "tags", comparison))[pages.NOTE]
    assert "**inconclusive** (adjusted p = 0.75): SAC leads" in note
    assert "**supported** (adjusted p = 0.01): PGPE is slow" in note


def test_all_seeds_of_an_agent_are_a_run_too(project: Path) -> None:
    """With the interquartile mean and its interval at each step, under the comparison."""
    (parent,) = runs(project, "comparison-%")
    for name in AGGREGATES:
        assert parent_name(project, name) == parent
        points = content(project, "metrics", name)
        ends = {"return_high": 5, "return_iqm": 0, "return_low": -5}
        curve = [
            (metric, step, step + more) for metric, more in ends.items() for step in (200, 400)
        ]
        assert [point for point in points if point[1]] == curve
        assert {("evaluation/return", 0, 65.0), ("evaluation/return_worst", 0, 15.0)} <= set(points)


def test_models_lead_back_to_the_policy_file(project: Path) -> None:
    policy = Paths(project).agent("sac").seed(1).policy
    sql = "SELECT description FROM model_versions WHERE name = 'jumping-ant-sac' AND version = 2"
    version = query(project, sql)[0][0]
    assert version.startswith(
        "sac, training seed 1: mean return 115 on the held-out episodes, 601 in validation, "
        "apex of its jumps 2.5 m, share of time in flight 0.25. "
        "Each output is held for 1 control step."
    )
    md5 = hashlib.md5(policy.read_bytes()).hexdigest()
    assert md5 in version and digest(policy) in version and "train@sac" in version
    metrics = query(
        project,
        "SELECT metric_name, metric_value FROM logged_model_metrics m JOIN logged_models l "
        "ON l.model_id = m.model_id WHERE l.name = 'sac-seed-1'",
    )
    measured = {"evaluation/return": 115.0, "evaluation/apex": 2.5, "evaluation/flight": 0.25}
    others = {"validation_return": 601.0, "final_return": 51.0, "train_seconds": 40.0}
    assert dict(metrics) == measured | others
    tags = query(project, "SELECT value FROM model_version_tags WHERE key = 'hold'")
    assert tags == [("1",)] * 4 and "tag `hold`" in models.ABOUT


def test_validation_is_of_the_policy_that_was_published(untracked_project: Path) -> None:
    """Of the finalists it is the best; one trained before there were finalists has none."""
    paths = Paths(untracked_project).agent("sac").seed(0)
    with paths.validation.open("a", encoding="utf-8") as file:
        file.write("sac,0,400,20,650,1.5\n")
    params = params_file.load(untracked_project / "params.yaml")
    assert records.read(untracked_project, params).seeds[0].validation_return == 650.0
    paths.validation.unlink()
    assert records.read(untracked_project, params).seeds[0].validation_return is None


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
    assert "media/digests" in stage["deps"]  # of the films and recordings that it reads
    own = ("params.yaml", "mlflow.db", "mlartifacts/", "media/")
    undeclared = [name for name in read if not name.startswith((*own, *stage["deps"]))]
    assert undeclared == [] and "results/plots/learning_curves.csv" in read


def test_the_uri_is_the_variable_or_the_project(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    assert connection.tracking_uri(tmp_path) == f"sqlite:///{tmp_path}/mlflow.db"
    temporary = tmp_path / ".dvc" / "tmp" / "exps" / "standalone" / "tmpx"
    assert connection.tracking_uri(temporary) == f"sqlite:///{tmp_path}/mlflow.db"
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://here:1")
    assert connection.tracking_uri(tmp_path) == "http://here:1"


def test_a_moved_project_or_a_damaged_database_is_told_in_one_line(project: Path) -> None:
    moved = project.with_name("moved")
    shutil.copytree(project, moved)
    with pytest.raises(InputError, match=r"was moved: delete mlflow\.db"):
        tracked(moved)
    (project / "mlflow.db").write_bytes(b"not a database" * 100)
    with pytest.raises(InputError, match="not a database") as caught:
        tracked(project)
    assert "\n" not in str(caught.value)


def test_a_damaged_curve_is_told_by_file(tmp_path: Path) -> None:
    path = Paths(tmp_path).agent("sac").seed(7).curve
    write_text(path, "agent,seed,env_steps,loss\nsac,7,100,much\n")
    with pytest.raises(InputError, match=r"curve\.csv: row 1, column loss: given 'much'"):
        records.read_curve(tmp_path, "sac", 7)
    write_text(path, "agent,seed,env_steps,loss,other\nsac,7,100,,\nsac,7,200,1.5,\nsac,7,300,2")
    assert records.read_curve(tmp_path, "sac", 7) == {("loss", 200): 1.5}
    write_text(path, "agent,seed,env_steps,loss,other\nsac,7,200,1.5,\nsac,7,200,,3\n")
    both = {("loss", 200): 1.5, ("other", 200): 3.0}  # a row of training, and one of an evaluation
    assert records.read_curve(tmp_path, "sac", 7) == both


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("results/agents/{}/trajectory.npz", "given an episode of agent 'pgpe', allowed: 'sac'"),
        ("results/timing/{}/timing.csv", "column agent: given 'pgpe', allowed: sac"),
        ("results/agents/{}/seeds.csv", "column agent: given 'pgpe', allowed: sac"),
        ("results/agents/{}/variants.csv", "column agent: given 'pgpe', allowed: sac"),
        ("models/{}/seed-0/curve.csv", "column agent: given 'pgpe', allowed: sac"),
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
