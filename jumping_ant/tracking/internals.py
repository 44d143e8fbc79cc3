"""Interfaces of MLflow that it does not document, checked against MLflow 3.17.2."""

import json
import logging
import os
import warnings
from collections.abc import Sequence
from typing import Any

from mlflow.store.tracking.sqlalchemy_store import SqlAlchemyStore
from mlflow.utils.mlflow_tags import MLFLOW_MODEL_VERSIONS

# Tags that the pages read. The first decides which pages an experiment has.
EXPERIMENT_KIND = {"mlflow.experimentKind": "custom_model_development"}
RUN_COLOUR = "mlflow.runColor"
# Makes the table of runs unfold the comparison above the run, where other runs stay folded; it says
# nothing about the run except that it has been evaluated.
UNFOLDED = {"mlflow.runType": "evaluation"}
FIRST_COLUMN = "attributes.`Run Name`"  # this one and the last two cannot be hidden
LAST_COLUMNS = ("duration", "runDateAndNestInfo")


def saved_view(
    key: str, name: str, columns: Sequence[str], condition: str, order: str
) -> dict[str, str]:
    """Return an experiment's tag that saves a view of its runs.

    Args:
        key: By which an address names it.
        name: By which the menu names it.
        columns: Beside those that are always shown, in their order.
        condition: On runs, in the language of searches.
        order: The column by which runs are sorted, the largest first.
    """
    state = {
        "searchFilter": condition,
        "orderByKey": order,
        "orderByAsc": False,
        "startTime": "ALL",
        "lifecycleFilter": "Active",
        "selectedColumns": list(columns),
        "columnOrder": [FIRST_COLUMN, *columns, *LAST_COLUMNS],
        "columnWidths": {},  # the page looks each column up in it
    }
    # The times only order the list of views.
    view = {"name": name, "createdAt": 0, "updatedAt": 0, "state": json.dumps(state)}
    return {f"mlflow.sharedViewState.{key}": json.dumps(view)}


def view_address(experiment_id: str, key: str) -> str:
    """Return the address of a saved view, relative to that of MLflow's pages."""
    query = f"workflowType=machine_learning&viewStateShareKey={key}"
    return f"#/experiments/{experiment_id}/runs?{query}"


def silence() -> None:
    """Keep MLflow from printing; its variables re-enable its output."""
    os.environ.setdefault("MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT", "true")
    os.environ.setdefault("MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR", "false")
    levels = {"mlflow.store.db.utils": logging.CRITICAL}  # tracebacks of errors reported elsewhere
    if "MLFLOW_LOGGING_LEVEL" not in os.environ:
        # The last one logs every retry.
        levels |= {"mlflow": logging.ERROR, "urllib3": logging.ERROR}
    for name, level in levels.items():
        logging.getLogger(name).setLevel(level)


def create_tables(database_uri: str, artifacts_uri: str) -> None:
    """Make the tables of an empty database; the client would quote no folder name for this."""
    SqlAlchemyStore(database_uri, artifacts_uri)


def registered_tag(name: str, version: str) -> dict[str, str]:
    """Return the tag by which a model's page leads to the version that it is registered as."""
    return {MLFLOW_MODEL_VERSIONS: json.dumps([{"name": name, "version": version}])}


def server(database_uri: str, artifacts_uri: str) -> Any:
    """Return MLflow's server, an ASGI application, without its proxy for artifacts."""
    os.environ |= {
        "_MLFLOW_SERVER_FILE_STORE": database_uri,
        "_MLFLOW_SERVER_ARTIFACT_ROOT": artifacts_uri,
        "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false",
    }
    with warnings.catch_warnings(action="ignore"):  # about packages that MLflow uses
        from mlflow.server.fastapi_app import app  # reads the variables
    return app
