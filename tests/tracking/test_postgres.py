"""MLflow's records in PostgreSQL, as several machines share them."""

import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mlflow
import pytest
import sqlalchemy
from alembic import command
from mlflow.store.db import utils
from tracked_project import AGGREGATES, make_bare, make_whole, tracked

from jumping_ant.base.errors import InputError
from jumping_ant.tracking import internals

if TYPE_CHECKING:
    from soak.postgres import Postgres

COMPARISON = "comparison-7a907229"
OF_MLFLOW_2 = "cc1f77228345"  # the schema's version
SEEDS = {f"{agent}-seed-{seed}" for agent in ("sac", "pgpe") for seed in (0, 1)}
RUNS = {*SEEDS, *AGGREGATES, COMPARISON}


@pytest.fixture(scope="module")
def tables(postgres: "Postgres", tmp_path_factory: pytest.TempPathFactory) -> str:
    """The name of a database with nothing but MLflow's tables, to copy."""
    folder = tmp_path_factory.mktemp("artifacts")
    internals.create_tables(postgres.create("tables"), folder.as_uri())
    return "tables"


@pytest.fixture
def project(folder: Path, empty_database: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A project with everything trained, evaluated and compared."""
    for name in ("PGOPTIONS", "PGCONNECT_TIMEOUT"):
        monkeypatch.setenv(name, "")  # so that it is restored
        monkeypatch.delenv(name)
    make_bare(folder / "a project", empty_database)
    make_whole(folder / "a project")
    return folder / "a project"


@pytest.fixture
def database(
    postgres: "Postgres",
    tables: str,
    project: Path,
    request: pytest.FixtureRequest,
    monkeypatch: pytest.MonkeyPatch,
) -> str:
    """The name of a database of the test's own, which the environment names."""
    name = re.sub(r"\W", "_", request.node.name)[5:30]
    monkeypatch.setenv("MLFLOW_TRACKING_URI", postgres.create(name, tables))
    return name


def said(uri: str) -> dict[str, Any]:
    """What MLflow says, without ids and times."""
    client = mlflow.MlflowClient(uri)
    experiment = client.get_experiment_by_name("jumping-ant")
    assert experiment is not None and experiment.lifecycle_stage == "active"
    names = {}
    found = client.search_runs([experiment.experiment_id])
    for run in found:
        names[run.info.run_id] = run.info.run_name
    said: dict[str, Any] = {}
    for run in found:
        assert run.info.run_name not in said
        parent = run.data.tags.get("mlflow.parentRunId")
        said[run.info.run_name] = (
            run.info.status,
            names.get(parent),
            run.data.params,
            {
                name: [
                    (point.step, point.value)
                    for point in client.get_metric_history(run.info.run_id, name)
                ]
                for name in run.data.metrics
            },
            sorted(entry.path for entry in client.list_artifacts(run.info.run_id)),
        )
    for model in client.search_registered_models():
        versions = client.search_model_versions(f"name = '{model.name}'")
        of_runs = {version.version: names.get(version.run_id) for version in versions}
        said[model.name] = sorted(map(str, of_runs.values())), of_runs[model.aliases["champion"]]
    return said


def test_all_is_recorded_and_what_is_deleted_by_hand_comes_back(
    postgres: "Postgres", database: str, project: Path
) -> None:
    """Between them the server is stopped, killed and started again."""
    uri = postgres.uri(database)
    assert tracked(project)[-1].endswith(f"/{database}: 4 created")
    whole = said(uri)
    assert whole.keys() == {*RUNS, "jumping-ant-sac", "jumping-ant-pgpe"}
    assert all(whole[run][1] == COMPARISON for run in {*SEEDS, *AGGREGATES})
    assert whole["jumping-ant-sac"] == (["sac-seed-0", "sac-seed-1"], "sac-seed-1")
    postgres.stop()
    with pytest.raises(InputError, match="Connection refused"):
        tracked(project)
    postgres.start()
    assert tracked(project)[-1].endswith(": 4 unchanged")
    client = mlflow.MlflowClient(uri)
    client.delete_registered_model("jumping-ant-sac")
    client.delete_registered_model_alias("jumping-ant-pgpe", "champion")
    for run in client.search_runs([client.get_experiment_by_name("jumping-ant").experiment_id]):
        if run.info.run_name in ("sac-seed-0", AGGREGATES[0], COMPARISON):
            client.delete_run(run.info.run_id)
    postgres.kill()
    postgres.start()
    told = tracked(project)
    assert said(uri) == whole, told
    assert tracked(project)[-1].endswith(": 4 unchanged")
    client.delete_experiment(client.get_experiment_by_name("jumping-ant").experiment_id)
    told = tracked(project)  # restores all that was ever deleted
    assert said(uri) == whole, told
    assert tracked(project)[-1].endswith(": 4 unchanged")


def test_two_machines_track_the_same_at_once(
    postgres: "Postgres", project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Into an empty database, whose tables both want to make."""
    uri = postgres.create("two")
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
    code = (
        "import sys; from pathlib import Path; from jumping_ant.tracking.mirror import track; "
        "print(flush=True); input(); track(Path(sys.argv[1]))"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, str(project)],
        cwd=tmp_path,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        encoding="utf-8",
    ) as other:
        assert other.stdin and other.stdout
        other.stdout.readline()  # it is ready
        other.stdin.write("\n")
        other.stdin.flush()
        own = tracked(project)
        others = other.communicate(timeout=120)[0].splitlines()
    ends = sorted(told[-1].partition("/two: ")[2] for told in (own, others))
    assert ends == ["4 created", "4 unchanged"]
    assert said(uri).keys() == {*RUNS, "jumping-ant-sac", "jumping-ant-pgpe"}


def make_older_tables(uri: str) -> None:
    """Make the tables that MLflow 2.0 made, with a run that it recorded."""
    config = utils._get_alembic_config(uri)
    engine = sqlalchemy.create_engine(uri)
    utils.InitialBase.metadata.create_all(engine)
    with engine.begin() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, OF_MLFLOW_2)
        for sql in (
            "INSERT INTO experiments (name, artifact_location, lifecycle_stage) "
            "VALUES ('others', 'file:///others', 'active')",
            "INSERT INTO runs "
            "(run_uuid, name, user_id, status, experiment_id, lifecycle_stage, start_time) "
            f"SELECT '{'0' * 32}', 'old', 'me', 'FINISHED', experiment_id, 'active', 1 "
            "FROM experiments",
        ):
            connection.execute(sqlalchemy.text(sql))
    engine.dispose()


def test_a_schema_of_an_older_mlflow_is_renewed_and_one_of_a_newer_is_left(
    postgres: "Postgres", project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    uri = postgres.create("older")
    make_older_tables(uri)
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
    assert tracked(project)[-1].endswith("/older: 4 created")
    assert said(uri).keys() == {*RUNS, "jumping-ant-sac", "jumping-ant-pgpe"}
    assert mlflow.MlflowClient(uri).get_run("0" * 32).info.run_name == "old"
    postgres.create("newer", "older")
    postgres.query("UPDATE alembic_version SET version_num = '000000000000'", "newer")
    monkeypatch.setenv("MLFLOW_TRACKING_URI", postgres.uri("newer"))
    with pytest.raises(InputError, match="/newer: .*000000000000"):
        tracked(project)


def test_a_locked_database_is_not_waited_for(
    postgres: "Postgres", database: str, project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tracked(project)
    monkeypatch.setenv("PGOPTIONS", "-c lock_timeout=500ms")
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"{postgres.uri(database)}?application_name=again")
    with postgres.locked("runs", database), pytest.raises(InputError, match="in use by another"):
        tracked(project)
    assert tracked(project)[-1].endswith(": 4 unchanged")


@pytest.mark.parametrize(
    ("wrong", "right", "told"),
    [
        ("robot:", "robot:not", "password authentication failed for user"),
        ("/postgres", "/nothing", 'database "nothing" does not exist'),
    ],
)
def test_a_database_that_lets_nobody_in_is_told_at_once(
    postgres: "Postgres",
    project: Path,
    monkeypatch: pytest.MonkeyPatch,
    wrong: str,
    right: str,
    told: str,
) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", postgres.uri("postgres").replace(wrong, right))
    began = time.monotonic()
    with pytest.raises(InputError, match=told) as caught:
        tracked(project)
    assert time.monotonic() - began < 10  # MLflow itself tries for 100 seconds
    assert postgres.password not in str(caught.value) and "\n" not in str(caught.value)
