"""MLflow's records in PostgreSQL, as several machines share them."""

from pathlib import Path
from typing import TYPE_CHECKING

import mlflow
import pytest
from tracked_project import AGGREGATES, tracked

from jumping_ant.base.errors import InputError

if TYPE_CHECKING:
    from soak.postgres import Postgres


def test_all_is_recorded_and_what_is_deleted_comes_back(
    postgres: "Postgres", untracked_project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The server is stopped, locked and started between them; a password is in no message."""
    for name in ("PGOPTIONS", "PGCONNECT_TIMEOUT"):
        monkeypatch.setenv(name, "")  # so that it is restored
        monkeypatch.delenv(name)
    project, uri = untracked_project, postgres.create("mlflow")
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri.replace("robot:", "robot:not"))
    with pytest.raises(InputError, match="password authentication failed") as caught:
        tracked(project)
    assert postgres.password not in str(caught.value) and "\n" not in str(caught.value)
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
    assert tracked(project)[-1].endswith("/mlflow: 4 created")
    postgres.stop()
    with pytest.raises(InputError, match="Connection refused"):
        tracked(project)
    postgres.start()
    monkeypatch.setenv("PGOPTIONS", "-c lock_timeout=500ms")
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"{uri}?application_name=again")
    with postgres.locked("runs", "mlflow"), pytest.raises(InputError, match="in use by another"):
        tracked(project)
    client = mlflow.MlflowClient(uri)
    client.delete_registered_model("jumping-ant-sac")
    experiment = client.get_experiment_by_name("jumping-ant").experiment_id
    client.delete_experiment(experiment)
    tracked(project)
    assert tracked(project)[-1].endswith(": 4 unchanged")
    found = [run.info.run_name for run in client.search_runs([experiment])]
    assert len(found) == len(set(found)) == 7 and {*AGGREGATES, "sac-seed-0"} <= set(found)
    assert client.get_model_version_by_alias("jumping-ant-sac", "champion")
