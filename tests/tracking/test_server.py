"""MLflow over HTTP, and the models it serves."""

import ast
import json
import shutil
import socket
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from mlflow.pyfunc import PythonModelContext
from tracked_project import (
    OnServer,
    make_bare,
    make_whole,
    run_python,
    state,
    tracked,
)

from jumping_ant.base import imports
from jumping_ant.base.errors import InputError
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.blind import UniformPolicy
from jumping_ant.tracking import connection, live, models, serving


@pytest.mark.parametrize("is_silent", [False, True])
def test_a_server_that_does_not_answer_is_told_in_one_line(
    is_silent: bool,
    untracked_project: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
        if not is_silent:
            server.close()
        monkeypatch.setenv("MLFLOW_TRACKING_URI", f"http://me:secret@{address}")
        began = time.monotonic()
        with pytest.raises(InputError, match=f"MLflow at http://{address}: cannot be") as caught:
            tracked(untracked_project)
        live.follow("sac", untracked_project, lambda seconds: True)
        assert time.monotonic() - began < 25
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1 and "training continues" in said
    assert "\n" not in str(caught.value) and "secret" not in said + str(caught.value)


def test_a_server_gets_all_and_serves_the_champion(
    on_server: OnServer, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    server, project = on_server.address, on_server.project
    monkeypatch.setenv("MLFLOW_TRACKING_URI", server)
    assert on_server.told[-1] == f"MLflow at {server}: 3 created, 1 replaced"
    assert not (project / "mlartifacts").exists()
    before = state(on_server.folder)[0]
    assert tracked(project) == [f"MLflow at {server}: 4 unchanged"]
    assert state(on_server.folder)[0] == before
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
    (tmp_path / "policy.zip").write_bytes(UniformPolicy(7, ActionSet(), 8).to_bytes())
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
    for path in imports.closure(models.CODE):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                found.add(str(node.module).partition(".")[0])
    third_party = found - set(sys.stdlib_module_names) - {"jumping_ant"}
    assert third_party == set(models.REQUIREMENTS)


@pytest.mark.parametrize(
    ("uri", "line"),
    [
        ("postgresql://me:se/cret@words@127.0.0.1/db", "MLflow at postgresql://127.0.0.1/db: "),
        ("postgresql://me:secret@127.0.0.1/db", "its driver is not installed; run: make shared"),
        ("mysql+pymysql://me:secret@host/db", "not installed; run: pip install pymysql"),
        ("sqlite:///", "MLFLOW_TRACKING_URI: given 'sqlite:///', allowed: "),
        ("nonsense", "MLflow at nonsense: "),
    ],
)
def test_an_odd_uri_ends_in_one_line(
    uri: str, line: str, untracked_project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
    monkeypatch.setitem(sys.modules, "psycopg", None)  # as if it was not installed
    with pytest.raises(InputError) as caught:
        tracked(untracked_project)
    told = str(caught.value)
    assert line in told and "\n" not in told
    assert "cret" not in told and "words" not in told


@pytest.mark.parametrize("uri", ["sqlite:///x.db?timeout=60", "sqlite+pysqlite:///x.db"])
def test_a_databases_address_may_name_a_driver_and_options(
    uri: str, folder: Path, empty_database: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(empty_database, folder / "x.db")
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
    connection.connect(folder, timeout_seconds=5, max_retries=0)
    with connection.mirrored_alone(uri, print):
        pass
    locks = {"x.db.lock", "x.db.mirror.lock"}
    assert {path.name for path in folder.iterdir()} == {"x.db", *locks}


def test_any_folder_name_will_do(
    folder: Path, empty_database: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    project = folder / "ünï ?#% 'folder' \"x\""
    make_bare(project, empty_database)
    make_whole(project)
    monkeypatch.chdir(project)  # as commands do
    assert tracked(project)[-1].endswith("4 created")
    assert tracked(project)[-1].endswith("4 unchanged")
    assert list(folder.iterdir()) == [project] and (project / "mlflow.db").is_file()
