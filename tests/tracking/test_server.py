"""MLflow over HTTP, and the models it serves."""

import json
import os
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from mlflow.pyfunc import PythonModelContext
from tracked_project import OnServer, follow, make_bare, make_whole, state, tracked

from jumping_ant.base import imports
from jumping_ant.base.errors import InputError
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.blind import UniformPolicy
from jumping_ant.tracking import models, serving


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
        follow(untracked_project, lambda seconds: True)
        assert time.monotonic() - began < 25
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1 and "training continues" in said
    assert "\n" not in str(caught.value) and "secret" not in said + str(caught.value)


def test_a_server_gets_all_and_serves_the_champion(
    on_server: OnServer, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    server, project = on_server.address, on_server.project
    monkeypatch.setenv("MLFLOW_TRACKING_URI", server)
    assert on_server.lines[-1] == f"MLflow at {server}: 3 created, 1 replaced"
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
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    environment |= {"MLFLOW_TRACKING_URI": server, "MLFLOW_ALLOW_PICKLE_DESERIALIZATION": "false"}
    environment["MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR"] = "false"
    command = [sys.executable, "-c", code]
    output = subprocess.check_output(command, cwd=tmp_path, env=environment)
    # Every number of seed 1's policy is 0.2: (0 - 0.2) / 0.2 * 0.2 * 27 + 0.2 is below -1.
    assert json.loads(output) == [[3, 8], "float64", -1.0]


def test_a_served_policy_begins_new_episodes_with_a_batch_of_another_size(tmp_path: Path) -> None:
    path = tmp_path / "policy.zip"
    path.write_bytes(UniformPolicy(7, ActionSet(), 8).to_bytes())
    context, model = PythonModelContext({"policy": str(path)}, None), serving.ServedPolicy()
    model.load_context(context)
    batches = (np.zeros((size, 27)) for size in (2, 2, 1, 2))
    first, second, one, again = (model.predict(context, batch) for batch in batches)
    assert not np.array_equal(first, second)
    np.testing.assert_array_equal([*first, first[0]], [*again, *one])


def test_a_model_brings_the_packages_it_needs() -> None:
    modules = {name for path in imports.closure(models.CODE) for name in imports.modules(path)}
    packages = {name.partition(".")[0] for name in modules}
    assert packages - sys.stdlib_module_names - {"jumping_ant"} == set(models.REQUIREMENTS)


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
    message = str(caught.value)
    assert line in message and "\n" not in message
    assert "cret" not in message and "words" not in message


def test_a_databases_address_may_name_a_driver_and_options(
    bare_project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(bare_project)
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "sqlite+pysqlite:///mlflow.db?timeout=60")
    tracked(bare_project)
    assert all(path.name.endswith((".db", ".lock")) for path in bare_project.glob("mlflow*"))


def test_any_folder_name_will_do(
    folder: Path, empty_database: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    project = folder / "ünï ?#% 'folder' \"x\""
    make_bare(project, empty_database)
    make_whole(project)
    monkeypatch.chdir(project)  # as commands do
    assert tracked(project)[-1].endswith("4 created")
    assert list(folder.iterdir()) == [project] and (project / "mlflow.db").is_file()
