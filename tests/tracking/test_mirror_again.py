"""MLflow mirrors the files: what later calls add, replace, and leave."""

import hashlib
import os
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import mlflow
import pytest
from tracked_project import (
    AGENTS,
    NUM_RUNS,
    SEEDS,
    meaning,
    parent_name,
    query,
    shown,
    state,
    statuses,
    tracked,
    train,
)

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT, digest, write_json
from jumping_ant.base.paths import Paths
from jumping_ant.params import params_file
from jumping_ant.tracking import pages, store
from jumping_ant.tracking.mirror import track

ALIASES = "SELECT name, version FROM registered_model_aliases WHERE alias = 'champion' ORDER BY 1"
TRACK = "import pathlib, sys; from jumping_ant.tracking.mirror import track; "
TRACK += "track(pathlib.Path(sys.argv[1]))"


def change(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


def ids(project: Path) -> set[str]:
    active = query(project, "SELECT run_uuid FROM runs WHERE lifecycle_stage = 'active'")
    return {run for (run,) in active}


def test_a_second_call_adds_nothing(project: Path) -> None:
    """Nor does one after a model was loaded, in whose folder MLflow leaves a file."""
    client = store.connect(project).client
    mine = client.create_run("1", run_name="mine")  # someone else's, which stays open
    note = "SELECT value FROM experiment_tags WHERE key = 'mlflow.note.content'"
    assert pages.address("1") in query(project, note)[0][0]
    query(project, "UPDATE experiment_tags SET value = 'Mine' WHERE key = 'mlflow.note.content'")
    before = state(project)
    lines: list[str] = []
    track(project, lines.append, "http://127.0.0.1:5000/")
    last = f"MLflow at sqlite:///{project}/mlflow.db: 4 unchanged"
    assert lines == [last, f"Look at http://127.0.0.1:5000/{pages.address('1')}"]
    assert state(project) == before
    mlflow.pyfunc.load_model("models:/jumping-ant-sac@champion")
    assert tracked(project) == [last]
    assert state(project)[0] == before[0]
    assert client.get_run(mine.info.run_id).info.status == "RUNNING"
    assert query(project, note) == [("Mine",)]


NAMELESS = """
SELECT name FROM runs WHERE lifecycle_stage = 'active'
AND run_uuid NOT IN (SELECT run_uuid FROM tags WHERE key = 'git_commit')
"""
COMMITS = """
SELECT value FROM tags WHERE key IN ('git_commit', 'mlflow.source.git.commit')
UNION ALL SELECT value FROM model_version_tags WHERE key = 'git_commit'
UNION ALL SELECT tag_value FROM logged_model_tags WHERE tag_key = 'git_commit'
"""


def lock(project: Path, **params: object) -> None:
    """Write what training leaves, and what DVC notes of it."""
    params = dict(params_file.read(project / "params.yaml")) | params
    stages = {}
    for agent in AGENTS:
        paths = Paths(project).agent(agent)
        files = {seed: filter(Path.exists, paths.seed(seed).files) for seed in SEEDS}
        written = {str(seed): {it.name: digest(it) for it in its} for seed, its in files.items()}
        write_json(paths.training, written)
        kept = {"seeds": [0], "env": params["env"], f"agents.{agent}": params["agents"][agent]}
        stages[f"train@{agent}"] = locked(project, kept, paths.training)
        stages[f"evaluate@{agent}"] = locked(project, {}, paths.seed_means, paths.variants)
    paths = Paths(project)
    stages["compare"] = locked(project, {}, paths.comparison)
    stages |= {
        "timing": locked(project, {}, paths.speed),
        "report": locked(project, {}, paths.report),
    }
    stages["build"] = locked(project, {"robot": params["robot"], "record.fps": 0})
    write_json(project / "dvc.lock", {"schema": "2.0", "stages": stages})


def locked(project: Path, params: Mapping[str, object], *paths: Path) -> dict[str, object]:
    md5s = [hashlib.md5(path.read_bytes(), usedforsecurity=False).hexdigest() for path in paths]
    names = [str(path.relative_to(project)) for path in paths]
    outs = [{"path": name, "md5": md5} for name, md5 in zip(names, md5s, strict=True)]
    return {"params": {"params.yaml": params}, "outs": outs}


def commit(project: Path, *names: str) -> str:
    settings = ["-c", "user.name=A", "-c", "user.email=a@b.c"]
    for command in (["init", "-q"], ["add", "-f", *names], ["commit", "--allow-empty", "-qm", "A"]):
        subprocess.run(["git", *settings, *command], cwd=project, check=True)
    return subprocess.check_output(["git", "rev-parse", "HEAD"], cwd=project, text=True).strip()


def test_the_commit_that_holds_what_was_run_is_named_once(untracked_project: Path) -> None:
    """A commit before it has other parameters, one around the project nothing of it."""
    project = untracked_project
    lock(project)
    commit(project.parent)
    tracked(project)
    commit(project, "params.yaml")
    tracked(project)
    assert query(project, COMMITS) == []
    first = commit(project, "dvc.lock")
    tracked(project)
    named = query(project, COMMITS)
    # Of the comparison, its aggregates and seeds; of versions and models.
    assert named == [(first,)] * (2 * NUM_RUNS + 2 * len(AGENTS) * len(SEEDS))
    before = state(project)
    assert commit(project) != first
    tracked(project)
    assert state(project) == before and query(project, COMMITS) == named
    change(project / "results" / "agents" / "sac" / "seeds.csv", "1,115,", "1,5,")
    train(project, "pgpe", 0, value=0.5)
    lock(project)
    assert tracked(project)[-1].endswith("1 created, 1 replaced, 2 unchanged")
    names = sorted(name for (name,) in query(project, NAMELESS))
    assert names[1:] == ["pgpe, 2 seeds", "pgpe-seed-0", "sac, 2 seeds", "sac-seed-1"]


def test_what_was_trained_with_other_parameters_is_not_shown_with_these(project: Path) -> None:
    """A setting was changed after training, or before it and the robot was not built again."""
    lock(project)
    assert tracked(project)[-1].endswith(": 4 unchanged")
    before = ids(project)
    change(project / "params.yaml", "learning_rate: 5.0e-4", "learning_rate: 6.0e-4")
    first, *_, last = tracked(project)
    assert first == "not trained yet: sac seed 0, sac seed 1"
    assert last.endswith(": 2 unchanged") and ids(project) == before


def test_what_a_stage_left_that_was_refused_is_not_shown(project: Path) -> None:
    """Its policies may be those of parameters that were saved over, or of other code."""
    lock(project)
    kept = (project / "dvc.lock").read_bytes()
    train(project, "sac", 0, value=0.5)
    lock(project)
    (project / "dvc.lock").write_bytes(kept)
    assert tracked(project)[0] == "not trained yet: sac seed 0, sac seed 1"


@pytest.mark.parametrize("lock", ["stages:", "[]", "stages: {train@sac: }", "[" * 5000, "{", "\0"])
def test_a_lock_that_dvc_has_not_written_is_none(project: Path, lock: str) -> None:
    (project / "dvc.lock").write_text(lock, encoding="utf-8")
    commit(project, "dvc.lock")
    assert tracked(project)[-1].endswith(": 4 unchanged")


def test_a_policy_that_was_not_trained_is_not_shown(project: Path) -> None:
    lock(project)
    paths = Paths(project).agent("sac")
    train(project, "sac", 1, value=0.75)  # another one of that agent and seed, of whomever
    given = digest(paths.seed(1).policy)[:8]
    with pytest.raises(InputError, match=f"seed-1/policy.zip: given another file .*{given}"):
        tracked(project)
    paths.seed(1).policy.unlink()
    assert tracked(project)[0] == "not trained yet: sac seed 1"


def test_other_parameters_leave_earlier_runs_alone_and_their_own_come_back(project: Path) -> None:
    """Also if policies are the same, as those of an agent that acts at random."""
    first = ids(project)
    assert query(project, ALIASES) == [("jumping-ant-pgpe", 2), ("jumping-ant-sac", 2)]
    shutil.copytree(project / "models", project / "kept")
    shutil.copy(project / "params.yaml", project / "kept.yaml")
    change(project / "params.yaml", "max_episode_steps: 1000", "max_episode_steps: 900")
    train(project, "sac", 0, value=0.7)
    change(project / "models/sac/seed-0/validation.csv", ",600,", ",700,")
    lines = tracked(project)
    assert lines[-1].endswith(": 4 created")
    assert query(project, ALIASES) == [("jumping-ant-pgpe", 4), ("jumping-ant-sac", 3)]
    both = ids(project)
    assert first < both and len(both) == 2 * len(first)
    shutil.rmtree(project / "models")
    (project / "kept").rename(project / "models")
    (project / "kept.yaml").rename(project / "params.yaml")
    assert tracked(project)[-1].endswith(": 4 unchanged") and ids(project) == both
    assert query(project, ALIASES) == [("jumping-ant-pgpe", 2), ("jumping-ant-sac", 2)]
    found = query(project, "SELECT run_uuid, value FROM tags WHERE key = 'mlflow.parentRunId'")
    assert {run for run, parent in found if parent in first} < first


def test_a_changed_evaluation_replaces_runs_and_leaves_names_of_models(project: Path) -> None:
    store.connect(project).client.set_registered_model_alias("jumping-ant-sac", "mine", "2")
    change(project / "results" / "agents" / "sac" / "seeds.csv", "1,115,", "1,5,")
    change(Paths(project).plots / "learning_curves.csv", "sac,200.0,200", "sac,200.0,201")
    lines = tracked(project)
    assert lines[-1].endswith("1 replaced, 3 unchanged") and "sac, 2 seeds: replaced" in lines
    runs = shown(project)
    assert {run.status for run in runs.values()} == {"FINISHED"} and len(runs) == NUM_RUNS
    assert ("evaluation/return", 0, 5.0) in runs["sac-seed-1"].metrics
    assert ("return_iqm", 200, 201.0) in runs["sac, 2 seeds"].metrics
    aliases = query(project, "SELECT alias, version FROM registered_model_aliases ORDER BY name, 1")
    assert aliases == [("champion", 2), ("champion", 3), ("mine", 3)], "validation chooses"
    assert len(query(project, "SELECT * FROM model_versions WHERE current_stage = 'None'")) == 4
    assert tracked(project)[-1].endswith("4 unchanged")


def test_an_experiment_apart_does_not_name_the_champion(project: Path) -> None:
    """As of `dvc exp run --temp` and DVC's queue; the best in validation is the workspace's."""
    apart = project / ".dvc" / "tmp" / "exps" / "standalone" / "tmpx"
    for name in ("models", "results", "assets", "media", "params.yaml"):
        copy = shutil.copytree if (project / name).is_dir() else shutil.copy
        copy(project / name, apart / name)
    train(apart, "sac", 0, value=0.7)
    change(apart / "models/sac/seed-0/validation.csv", ",600,", ",700,")
    assert tracked(apart)[-1].endswith("1 created, 3 unchanged")
    assert query(project, ALIASES) == [("jumping-ant-pgpe", 2), ("jumping-ant-sac", 2)]


def test_what_is_deleted_by_hand_comes_back(untracked_project: Path) -> None:
    project = untracked_project
    tracked(project)
    said, client = meaning(project), store.connect(project).client

    def assert_back() -> None:
        tracked(project)
        assert meaning(project) == said

    for model in (project / "mlartifacts" / "models").iterdir():
        shutil.rmtree(model)
    (shown(project)["sac-seed-1"].artifacts / "policy.zip").unlink()
    query(project, "UPDATE runs SET status = 'RUNNING' WHERE name LIKE 'pgpe-seed-_'")
    assert_back()
    shutil.rmtree(project / "mlartifacts")
    assert_back()
    client.delete_registered_model("jumping-ant-sac")
    client.delete_registered_model_alias("jumping-ant-pgpe", "champion")
    for run in client.search_runs(["1"], "attributes.run_name LIKE '%0'"):
        client.delete_run(run.info.run_id)
    assert_back()
    client.delete_experiment("1")  # restored with it are the runs that were replaced above
    assert_back()
    assert tracked(project)[-1].endswith("4 unchanged")


def test_an_interrupted_call_is_completed_by_the_next(untracked_project: Path) -> None:
    project = untracked_project

    def stop(line: str) -> None:
        if line.startswith("sac seed 1"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        track(project, stop)
    tracked(project)
    assert list(statuses(project).values()) == ["FINISHED"] * NUM_RUNS
    assert len(query(project, "SELECT * FROM model_versions")) == 4


def test_runs_are_nested_when_all_policies_are_trained(untracked_project: Path) -> None:
    """Under the comparison just tracked, where they stay while another is not complete."""
    project = untracked_project
    policy = Paths(project).agent("pgpe").seed(1).policy
    policy.unlink()
    assert tracked(project)[0] == "not trained yet: pgpe seed 1"
    assert shown(project).keys() == {"sac-seed-0", "sac-seed-1", "pgpe-seed-0"}
    train(project, "pgpe", 1)
    assert tracked(project)[-1].endswith("1 created, 3 unchanged")
    first = parent_name(project, "sac-seed-0")
    policy.unlink()
    assert tracked(project)[-1].endswith("3 unchanged")
    assert parent_name(project, "sac-seed-0") == first
    train(project, "pgpe", 1, value=0.7)
    assert tracked(project)[-1].endswith("1 created, 3 unchanged")
    assert parent_name(project, "sac-seed-0") != first
    train(project, "pgpe", 1)
    assert tracked(project)[-1].endswith("4 unchanged")
    assert parent_name(project, "sac-seed-0") == first


def test_two_rebuild_a_wiped_database_at_once(project: Path) -> None:
    """As two pipelines on one database do, which have trained the same policies.

    MLflow alone leaves a broken one behind where two make its tables at once.
    """
    said = meaning(project)
    (project / "mlflow.db").unlink()
    command = [sys.executable, "-c", TRACK, str(project)]
    environment = os.environ | {"PYTHONPATH": str(PROJECT_ROOT)}
    two = [
        subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, encoding="utf-8")
        for _ in range(2)
    ]
    lines = [process.communicate()[0].splitlines() for process in two]
    waiter, builder = sorted(lines, key=len)
    assert waiter[-1].endswith(": 4 unchanged") and builder[-1].endswith(": 4 created")
    assert meaning(project) == said
    assert len(query(project, "SELECT name FROM runs")) == len(shown(project)) == NUM_RUNS
    assert query(project, "SELECT count(*) FROM experiments WHERE name = 'jumping-ant'") == [(1,)]


def test_a_database_in_use_is_not_called_damaged(project: Path) -> None:
    with sqlite3.connect(project / "mlflow.db") as other:
        other.execute("BEGIN EXCLUSIVE")
        with pytest.raises(InputError, match=r"mlflow.db: in use by another program"):
            tracked(project)
        other.rollback()
    other.close()
    assert tracked(project)[-1].endswith("4 unchanged")
