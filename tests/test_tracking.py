"""MLflow mirrors the files: real stores, a real server, real processes."""

import ast
import csv
import json
import os
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path

import mlflow
import numpy as np
import pytest
from mlflow.pyfunc import PythonModelContext
from ruamel.yaml import YAML

from jumping_ant import params as params_module
from jumping_ant import serving
from jumping_ant.errors import InputError
from jumping_ant.files import PROJECT_ROOT, digest, write_bytes, write_json, write_text
from jumping_ant.policies import LinearPolicy, UniformPolicy
from jumping_ant.tracking import live, models, records, store
from jumping_ant.tracking.mirror import track

AGENTS, SEEDS, STEPS = ("sac", "pgpe"), (0, 1), (100, 200, 300, 400)
HEADER = "env_steps,updates,episodes,return_mean,evaluation_return_mean,loss"
FRESH_PROCESS = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}


# A project as the pipeline leaves it, and what a database says about it.


def policy_content(value: float) -> bytes:
    def full(*shape: int) -> np.ndarray:
        return np.full(shape, value, np.float32)

    return LinearPolicy(full(8, 27), full(8), full(27), full(27)).to_bytes()


def curve_lines(seed: int, steps: tuple[int, ...] = STEPS) -> str:
    """One evaluation, in the third row; the first row has no finished episode."""
    rows = [
        f"{step},{step},{step // 100},{'' if step == 100 else step + seed},"
        f"{step * 2 if step == 300 else ''},{1 / step}"
        for step in steps
    ]
    return "\n".join([HEADER, *rows]) + "\n"


def train(root: Path, agent: str, seed: int, value: float | None = None) -> None:
    folder = records.seed_dir(root, agent, seed)
    write_text(folder / "curve.csv", curve_lines(seed))
    number = AGENTS.index(agent) + 0.1 * (seed + 1) if value is None else value
    write_bytes(folder / "policy.zip", policy_content(number))


def evaluate(root: Path, agent: str) -> None:
    """Mean return of seed 0: 15, of seed 1: 115; the video shows seed 1."""
    with (root / "results" / "timing" / f"{agent}.csv").open("w") as file:
        rows = [(seed, step, step / 10) for seed in SEEDS for step in STEPS]
        csv.writer(file).writerows([("seed", "env_steps", "seconds"), *rows])
    (root / "results" / agent).mkdir(exist_ok=True)
    rows = "".join(f"{seed},{100 * seed + 15},2.5,0.5\n" for seed in SEEDS)
    means = f"seed,return,peak_height,smoothness\n{rows}"
    write_text(root / "results" / "seeds" / f"{agent}.csv", means)
    np.savez(root / "results" / agent / "trajectories.npz", seed=1, qpos=np.zeros((3, 15)))
    write_bytes(root / "media" / f"{agent}.mp4", b"video of " + agent.encode())
    write_bytes(root / "media" / f"{agent}.rrd", b"recording of " + agent.encode())


def compare(root: Path) -> None:
    interval = {"iqm": 65.0, "low": 15.0, "high": 115.0}
    entry = {"seeds": 2, "return": interval, "env_steps": 400, "train_seconds": 40.0}
    write_json(
        root / "results" / "comparison.json",
        {
            "agents": dict.fromkeys(AGENTS, entry),
            "probability_of_improvement": {"sac>pgpe": {"p": 0.75, "low": 0.5, "high": 1.0}},
            "claims": [{"text": "SAC leads", "verdict": "inconclusive", "evidence": "p = 0.75"}],
        },
    )
    write_bytes(root / "results" / "figures" / "curves.png", b"picture")


@pytest.fixture(scope="module")
def empty_database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """MLflow takes seconds to make its tables: once is enough."""
    path = tmp_path_factory.mktemp("mlflow") / "empty.db"
    mlflow.MlflowClient(f"sqlite:///{path}").search_experiments()
    return path


def make_bare(root: Path, database: Path) -> None:
    yaml = YAML()
    content = yaml.load((PROJECT_ROOT / "params.yaml").read_text())
    content["seeds"] = list(SEEDS)
    content["agents"] = {agent: content["agents"][agent] for agent in AGENTS}
    (root / "results" / "timing").mkdir(parents=True)
    with (root / "params.yaml").open("w") as file:
        yaml.dump(content, file)
    write_json(root / "assets" / "jumping_ant.json", {"after": {"mass": 0.44, "parts": {"leg": 1}}})
    shutil.copy(database, root / "mlflow.db")


def make_whole(root: Path) -> None:
    for agent in AGENTS:
        for seed in SEEDS:
            train(root, agent, seed)
        evaluate(root, agent)
    compare(root)


def unset_variables(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("TRACKING_URI", "HTTP_REQUEST_MAX_RETRIES", "HTTP_REQUEST_TIMEOUT"):
        monkeypatch.setenv(f"MLFLOW_{name}", "")  # so that it is restored even if it is set later
        monkeypatch.delenv(f"MLFLOW_{name}")


@pytest.fixture(scope="module")
def tracked_template(tmp_path_factory: pytest.TempPathFactory, empty_database: Path) -> Path:
    root = tmp_path_factory.mktemp("template") / "a project"
    make_bare(root, empty_database)
    make_whole(root)
    with pytest.MonkeyPatch.context() as monkeypatch:
        unset_variables(monkeypatch)
        tracked(root)
    return root


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Where a test works. None may leave an ./mlruns."""
    unset_variables(monkeypatch)
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    assert not list(tmp_path.rglob("mlruns"))


@pytest.fixture
def bare_project(folder: Path, empty_database: Path) -> Path:
    """A project with nothing trained."""
    make_bare(folder / "a project", empty_database)
    return folder / "a project"


@pytest.fixture
def untracked_project(bare_project: Path) -> Path:
    """A project with everything trained, evaluated and compared."""
    make_whole(bare_project)
    return bare_project


@pytest.fixture
def project(folder: Path, tracked_template: Path) -> Path:
    """The same, tracked: a copy, with the paths in its database set right.

    MLflow remembers where the artifacts of a run are: a test that damages them needs runs of its
    own, and tracks `untracked_project`.
    """
    root = folder / "a project"
    shutil.copytree(tracked_template, root)
    for table, column in (
        ("experiments", "artifact_location"),
        ("runs", "artifact_uri"),
        ("logged_models", "artifact_location"),
    ):
        sql = f"UPDATE {table} SET {column} = replace({column}, ?, ?)"
        query(root, sql, tracked_template.as_uri(), root.as_uri())
    return root


def query(root: Path, sql: str, *arguments: object) -> list[tuple]:
    connection = sqlite3.connect(root / "mlflow.db")
    rows = connection.execute(sql, arguments).fetchall()
    connection.commit()
    connection.close()
    return rows


def runs(root: Path, name: str = "%") -> dict[str, str]:
    """Name and status of the runs that are not deleted; two of a name are an error."""
    found = query(
        root,
        "SELECT name, status FROM runs WHERE lifecycle_stage = 'active' AND name LIKE ?",
        name,
    )
    assert len(found) == len(dict(found)), found
    return dict(found)


def content(root: Path, table: str, name: str) -> list[tuple]:
    """Rows of a run's metrics, params or tags."""
    columns = "m.key, m.step, m.value" if table == "metrics" else "m.key, m.value"
    return sorted(
        query(
            root,
            f"SELECT {columns} FROM {table} m JOIN runs r ON r.run_uuid = m.run_uuid "
            "WHERE r.name = ? AND r.lifecycle_stage = 'active'",
            name,
        )
    )


def parent_name(root: Path, name: str) -> str:
    tag = dict(content(root, "tags", name))["mlflow.parentRunId"]
    return str(query(root, "SELECT name FROM runs WHERE run_uuid = ?", tag)[0][0])


def artifact_dir(root: Path, name: str) -> Path:
    sql = "SELECT run_uuid FROM runs WHERE name = ? AND lifecycle_stage = 'active'"
    return root / "mlartifacts" / query(root, sql, name)[0][0] / "artifacts"


def state(root: Path) -> tuple[dict[str, int], dict[str, int]]:
    """Rows of every table, and time of every artifact: what a call that adds nothing leaves."""
    tables = [row[0] for row in query(root, "SELECT name FROM sqlite_master WHERE type = 'table'")]
    files = [path for path in (root / "mlartifacts").rglob("*") if path.is_file()]
    return (
        {table: query(root, f"SELECT COUNT(*) FROM {table}")[0][0] for table in tables},
        {str(path): path.stat().st_mtime_ns for path in files},
    )


def meaning(root: Path) -> dict[str, object]:
    """What MLflow says, without ids and times."""
    said: dict[str, object] = {"runs": runs(root)}
    for name in runs(root):
        said[name] = (
            content(root, "metrics", name),
            content(root, "params", name),
            [tag for tag in content(root, "tags", name) if tag[0] in ("agent", "policy_digest")],
            sorted(path.name for path in artifact_dir(root, name).rglob("*") if path.is_file()),
        )
    said["versions"] = query(root, "SELECT name, version, description FROM model_versions")
    said["aliases"] = query(root, "SELECT name, alias, version FROM registered_model_aliases")
    return said


def tracked(root: Path) -> list[str]:
    lines: list[str] = []
    track(root, lines.append)
    return lines


def run_python(code: str, *arguments: str, cwd: Path, **environment: str) -> str:
    """Run Python in a process of its own that does not find the package by itself."""
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=cwd,
        env=FRESH_PROCESS | environment,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


# The mirror.


def test_a_run_shows_the_files_of_its_seed(project: Path) -> None:
    comparison = next(name for name in runs(project) if name.startswith("comparison"))
    assert runs(project) == dict.fromkeys(
        [comparison, "sac-seed-0", "sac-seed-1", "pgpe-seed-0", "pgpe-seed-1"], "FINISHED"
    )
    metrics = content(project, "metrics", "sac-seed-1")
    assert [row for row in metrics if row[0] == "return_mean"] == [
        ("return_mean", 200, 201.0),
        ("return_mean", 300, 301.0),
        ("return_mean", 400, 401.0),
    ]
    assert ("evaluation_return_mean", 300, 600.0) in metrics
    assert ("evaluation/return", 0, 115.0) in metrics
    assert ("train_seconds", 0, 40.0) in metrics
    assert len(metrics) == 4 * 3 + 3 + 1 + 3 + 1
    params = dict(content(project, "params", "sac-seed-1"))
    settings = params_module.load(project / "params.yaml")
    assert params["learning_rate"] == str(settings.agent("sac").learning_rate)
    assert params["env.reward.span"] == str(settings.env.reward.span)
    assert params["robot.mass"] == "0.44"
    tags = dict(content(project, "tags", "sac-seed-1"))
    policy_path = project / "models" / "sac" / "seed-1" / "policy.zip"
    assert tags["policy_digest"] == digest(policy_path)
    assert (tags["agent"], tags["seed"], tags["algorithm"]) == ("sac", "1", "sac")
    assert tags["dvc_stage"] == "train@sac"
    files = artifact_dir(project, "sac-seed-1")
    assert (files / "policy.zip").read_bytes() == policy_path.read_bytes()
    assert (files / "media" / "sac.mp4").read_bytes() == b"video of sac"
    assert not (artifact_dir(project, "sac-seed-0") / "media").exists()
    assert parent_name(project, "sac-seed-1") == comparison


def test_the_comparison_shows_its_headline_and_all_media(project: Path) -> None:
    comparison = next(name for name in runs(project) if name.startswith("comparison"))
    metrics = content(project, "metrics", comparison)
    assert ("sac/return_iqm", 0, 65.0) in metrics
    assert ("pgpe/env_steps", 0, 400.0) in metrics
    assert ("probability_of_improvement/sac_over_pgpe", 0, 0.75) in metrics
    files = artifact_dir(project, comparison)
    names = {str(path.relative_to(files)) for path in files.rglob("*") if path.is_file()}
    assert names == {
        "params.yaml",
        "jumping_ant.json",
        "comparison.json",
        "figures/curves.png",
        *(f"media/{agent}.{kind}" for agent in AGENTS for kind in ("mp4", "rrd")),
    }
    assert "**inconclusive**: SAC leads" in dict(content(project, "tags", comparison))[store.NOTE]


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


def test_an_interrupted_call_is_completed_by_the_next(untracked_project: Path) -> None:
    project = untracked_project

    def stop(line: str) -> None:
        if line.startswith("sac seed 1"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        track(project, stop)
    tracked(project)
    assert len(runs(project)) == 5
    assert set(runs(project).values()) == {"FINISHED"}
    assert len(query(project, "SELECT * FROM model_versions")) == 4


def test_a_wiped_database_is_rebuilt(project: Path) -> None:
    said = meaning(project)
    key = parent_name(project, "sac-seed-0").removeprefix("comparison-")
    (project / "mlflow.db").unlink()
    # In a process of its own: this one still holds the old database open.
    code = "import sys, pathlib; from jumping_ant.tracking.mirror import track; "
    code += "track(pathlib.Path(sys.argv[1]))"
    output = run_python(code, str(project), cwd=project, PYTHONPATH=str(PROJECT_ROOT))
    assert [line.partition(" (")[0] for line in output.splitlines()] == [
        f"comparison {key}: created",
        "sac seed 0: created",
        "sac seed 1: created",
        "jumping-ant-sac: champion is version 2, mean return 115.0",
        "pgpe seed 0: created",
        "pgpe seed 1: created",
        "jumping-ant-pgpe: champion is version 2, mean return 115.0",
        f"comparison {key}: updated",
        f"MLflow at sqlite:///{project}/mlflow.db: 4 created",
    ]
    assert meaning(project) == said


def test_points_that_contradict_the_files_are_replaced(project: Path) -> None:
    said = meaning(project)
    run_id = artifact_dir(project, "sac-seed-0").parent.name
    query(project, "UPDATE metrics SET value = 9 WHERE run_uuid = ? AND step = 400", run_id)
    assert "sac seed 0: a run that was not the files' was deleted" in tracked(project)
    assert meaning(project) == said


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


def test_a_changed_evaluation_updates_metrics_and_champion(project: Path) -> None:
    alias = "SELECT version FROM registered_model_aliases WHERE name = 'jumping-ant-sac'"
    assert query(project, alias) == [(2,)]
    path = project / "results" / "seeds" / "sac.csv"
    path.write_text(path.read_text().replace("1,115,", "1,5,"))
    tracked(project)
    assert query(project, alias) == [(1,)]
    latest = query(project, "SELECT value FROM latest_metrics WHERE key = 'evaluation/return'")
    assert sorted(latest) == [(5.0,), (15.0,), (15.0,), (115.0,)]


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


def test_nothing_trained_is_no_error(bare_project: Path) -> None:
    assert tracked(bare_project)[-1].endswith("nothing to show")
    assert runs(bare_project) == {}


# Where MLflow is.


def test_the_uri_is_the_variable_or_the_project(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    assert store.tracking_uri(tmp_path) == f"sqlite:///{tmp_path}/mlflow.db"
    temporary = tmp_path / ".dvc" / "tmp" / "exps" / "standalone" / "tmpx"
    assert store.tracking_uri(temporary) == f"sqlite:///{tmp_path}/mlflow.db"
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://here:1")
    assert store.tracking_uri(tmp_path) == "http://here:1"


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


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


def test_an_unreachable_server_is_told_in_one_line(
    untracked_project: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    project = untracked_project
    address = f"127.0.0.1:{free_port()}"
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"http://me:secret@{address}")
    began = time.monotonic()
    with pytest.raises(InputError, match=f"MLflow at http://{address}: cannot be") as caught:
        tracked(project)
    assert "\n" not in str(caught.value)
    live.follow("sac", project, lambda seconds: True)
    told = capsys.readouterr().err
    assert time.monotonic() - began < 20
    assert len(told.splitlines()) == 1
    assert "training goes on" in told
    assert "secret" not in told + str(caught.value)


@pytest.fixture
def server(tmp_path: Path, empty_database: Path) -> Iterator[str]:
    folder = tmp_path / "server"
    folder.mkdir()
    shutil.copy(empty_database, folder / "mlflow.db")
    uri = f"http://127.0.0.1:{free_port()}"
    command = [sys.executable, "-m", "mlflow", "server", "--workers", "1", "--host", "127.0.0.1"]
    command += ["--port", uri.rpartition(":")[2], "--artifacts-destination", str(folder / "files")]
    command += ["--backend-store-uri", f"sqlite:///{folder / 'mlflow.db'}"]
    process = subprocess.Popen(
        command,
        cwd=folder,
        env=os.environ | {"MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false"},  # seven processes less
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    wait_for(lambda: answers(uri))
    yield uri
    process.terminate()
    process.wait(30)


def answers(uri: str) -> bool:
    try:
        with urllib.request.urlopen(f"{uri}/health", timeout=5) as response:
            return bool(response.status == 200)
    except OSError:
        return False


def wait_for(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.1)


def test_a_server_gets_all_and_serves_the_champion(
    untracked_project: Path, server: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    project = untracked_project
    monkeypatch.setenv("MLFLOW_TRACKING_URI", server)
    assert tracked(project)[-1] == f"MLflow at {server}: 4 created"
    assert not (project / "mlartifacts").exists()
    before = state(tmp_path / "server")[0]
    assert tracked(project) == [f"MLflow at {server}: 4 unchanged"]
    assert state(tmp_path / "server")[0] == before
    code = (
        "import mlflow, numpy, json; "
        "model = mlflow.pyfunc.load_model('models:/jumping-ant-sac@champion'); "
        "torques = model.predict(numpy.zeros((3, 27))); "
        "print(json.dumps([torques.shape, str(torques.dtype), torques[0, 0]]))"
    )
    output = run_python(
        code,
        cwd=tmp_path,
        MLFLOW_TRACKING_URI=server,
        MLFLOW_ALLOW_PICKLE_DESERIALIZATION="false",
        MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR="false",
    )
    # Every number of seed 1's policy is 0.2: (0 - 0.2) / 0.2 * 0.2 * 27 + 0.2 is below -1.
    assert json.loads(output) == [[3, 8], "float64", -1.0]


def test_a_served_policy_begins_new_episodes_with_a_batch_of_another_size(tmp_path: Path) -> None:
    (tmp_path / "policy.zip").write_bytes(UniformPolicy(seed=7).to_bytes())
    context = PythonModelContext({"policy": str(tmp_path / "policy.zip")}, None)
    model = serving.ServedPolicy()
    model.load_context(context)
    first, second = (model.predict(context, np.zeros((2, 27))) for _ in range(2))
    one = model.predict(context, np.zeros((1, 27)))
    again = model.predict(context, np.zeros((2, 27)))
    assert not np.array_equal(first, second)
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(one, first[:1])


def test_a_model_brings_the_packages_it_needs() -> None:
    found: set[str] = set()
    todo = ["serving"]
    while todo:
        tree = ast.parse((PROJECT_ROOT / "jumping_ant" / f"{todo.pop()}.py").read_text())
        for node in ast.walk(tree):
            names = [alias.name for alias in getattr(node, "names", [])]
            if isinstance(node, ast.ImportFrom):
                module = str(node.module)
                inner = names if module == "jumping_ant" else [module.partition(".")[2]]
                names = [module]
                todo += [name for name in inner if module.startswith("jumping_ant")]
            if isinstance(node, ast.Import | ast.ImportFrom):
                found |= {name.partition(".")[0] for name in names}
    third_party = found - set(sys.stdlib_module_names) - {"jumping_ant"}
    assert third_party == set(models.REQUIREMENTS)


# Live curves.


def script(*steps: Callable[[], object]) -> Callable[[float], bool]:
    """Return a `has_ended` that does one step a call, and then says that training has ended."""
    todo = list(steps)

    def has_ended(seconds: float) -> bool:
        if todo:
            todo.pop(0)()
        return not todo

    return has_ended


def grow(root: Path, num_rows: int, seed: int = 0, agent: str = "sac", cut: int = 0) -> None:
    """Write the first rows of a curve, and a part of the next."""
    text = curve_lines(seed, STEPS[:num_rows]) + curve_lines(seed).splitlines()[-1][:cut]
    write_text(records.seed_dir(root, agent, seed) / "curve.csv", text)


def test_training_shows_while_it_runs_and_once_afterwards(bare_project: Path) -> None:
    seen: list[object] = []

    def look() -> None:
        steps = {row[1] for row in content(bare_project, "metrics", "sac-seed-0")}
        seen.append((runs(bare_project, "sac%"), steps))

    def finish() -> None:
        for seed in SEEDS:
            train(bare_project, "sac", seed)

    live.follow(
        "sac",
        bare_project,
        script(
            lambda: grow(bare_project, 2, cut=3), look, lambda: grow(bare_project, 3), look, finish
        ),
    )
    assert seen == [
        ({"sac-seed-0": "RUNNING"}, {100, 200}),
        ({"sac-seed-0": "RUNNING"}, {100, 200, 300}),
    ]
    finished = {"sac-seed-0": "FINISHED", "sac-seed-1": "FINISHED"}
    assert runs(bare_project) == finished | {"comparison (pending)": "FINISHED"}
    points = content(bare_project, "metrics", "sac-seed-0")
    assert len(points) == len(set(points)) == 16
    for seed in SEEDS:
        train(bare_project, "pgpe", seed)
    for agent in AGENTS:
        evaluate(bare_project, agent)
    assert tracked(bare_project)[-1].endswith("2 created, 2 repaired")
    assert [point for point in content(bare_project, "metrics", "sac-seed-0") if point[1]] == points
    assert set(runs(bare_project).values()) == {"FINISHED"}
    assert len(runs(bare_project)) == 5


def test_a_killed_training_is_marked_and_continued(bare_project: Path) -> None:
    live.follow("sac", bare_project, script(lambda: grow(bare_project, 3)))
    assert runs(bare_project, "sac%") == {"sac-seed-0": "KILLED"}
    began = query(bare_project, "SELECT run_uuid FROM runs WHERE name = 'sac-seed-0'")
    # Resumed from a checkpoint: the file is behind what MLflow has seen.
    live.follow(
        "sac",
        bare_project,
        script(lambda: grow(bare_project, 1), lambda: train(bare_project, "sac", 0)),
    )
    assert runs(bare_project, "sac%") == {"sac-seed-0": "FINISHED"}
    assert query(bare_project, "SELECT run_uuid FROM runs WHERE name = 'sac-seed-0'") == began
    assert len(content(bare_project, "metrics", "sac-seed-0")) == 16


def test_another_training_gets_another_run(bare_project: Path) -> None:
    live.follow("sac", bare_project, script(lambda: grow(bare_project, 3)))
    write_text(records.seed_dir(bare_project, "sac", 0) / "curve.csv", f"{HEADER}\n100,9,9,9,9,9\n")
    live.follow("sac", bare_project, script(lambda: None))
    found = query(bare_project, "SELECT name, status FROM runs WHERE name = 'sac-seed-0'")
    assert found == [("sac-seed-0", "KILLED")] * 2


def test_the_same_policy_again_leaves_its_run_alone(project: Path) -> None:
    before = state(project)[0]
    live.follow("sac", project, script(lambda: None))
    policy = project / "models" / "sac" / "seed-0" / "policy.zip"
    policy.unlink()
    live.follow("sac", project, script(lambda: None, lambda: train(project, "sac", 0)))
    assert len(runs(project)) == 5
    assert state(project)[0]["model_versions"] == before["model_versions"]
    assert tracked(project)[-1].endswith("4 unchanged")


def test_track_leaves_a_seed_in_training_to_its_follower(untracked_project: Path) -> None:
    project = untracked_project
    lines: list[str] = []
    policy = project / "models" / "sac" / "seed-0" / "policy.zip"
    policy.unlink()

    def look() -> None:
        train(project, "sac", 0)
        lines.extend(tracked(project))

    live.follow("sac", project, script(lambda: None, look))
    assert "sac seed 0: in training, left to the process that follows it" in lines
    tracked(project)
    assert len(runs(project)) == 5
    assert set(runs(project).values()) == {"FINISHED"}


def test_the_follower_ends_with_the_pipe_and_survives_being_killed(bare_project: Path) -> None:
    command = [sys.executable, "-m", "jumping_ant.tracking", "follow", "sac"]
    command += ["--root", str(bare_project)]

    def start() -> subprocess.Popen[str]:
        return subprocess.Popen(
            command, cwd=PROJECT_ROOT, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    grow(bare_project, 2)
    first = start()
    wait_for(lambda: len(content(bare_project, "metrics", "sac-seed-0")) == 7)
    first.send_signal(signal.SIGINT)  # Ctrl-C reaches the whole group; the pipe is what counts
    first.kill()
    first.communicate()
    assert runs(bare_project, "sac%") == {"sac-seed-0": "RUNNING"}
    second = start()
    train(bare_project, "sac", 0)
    assert second.communicate(timeout=60)[1] == ""  # closes the pipe
    assert second.returncode == 0
    assert runs(bare_project, "sac%") == {"sac-seed-0": "FINISHED"}
    assert len(content(bare_project, "metrics", "sac-seed-0")) == 16


def test_a_damaged_curve_is_told_by_file(tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    path.write_text("env_steps,loss\n100,much\n")
    with pytest.raises(InputError, match=r"curve\.csv: .*'much'"):
        records.read_curve(path)
    path.write_text("env_steps,loss,other\n100,nan,\n200,1.5,inf\n300,2")
    assert records.read_curve(path) == {("loss", 200): 1.5}
