"""How MLflow's pages present the experiment: a saved view, a description, an address.

By default MLflow shows no parameters and no metrics in its table of runs. It keeps saved views as
tags of the experiment; users choose them from the menu "Views" or open them by address.
"""

import json
from typing import Any

from jumping_ant.tracking.records import EVALUATION, FINAL_RETURN, TRAIN_SECONDS, VALIDATION_RETURN

VIEW = "comparison"
VIEW_TAG = f"mlflow.sharedViewState.{VIEW}"
VIEW_NAME = "Agents and seeds"
NOTE = "mlflow.note.content"
ABOUT = "Agents that teach a robot of MuJoCo to jump: one run per agent and seed."
KIND_TAGS = {"mlflow.experimentKind": "custom_model_development"}  # which pages MLflow offers

# Columns of the table, in their order, with their widths [pixels].
COLUMNS = {
    "attributes.`Run Name`": 190,
    "tags.`agent`": 80,
    "tags.`seed`": 60,
    f"metrics.`{EVALUATION}return`": 145,
    f"metrics.`{VALIDATION_RETURN}`": 145,
    f"metrics.`{FINAL_RETURN}`": 120,
    f"metrics.`{EVALUATION}apex`": 140,
    f"metrics.`{EVALUATION}flight`": 140,
    f"metrics.`{EVALUATION}fluidity`": 150,
    f"metrics.`{TRAIN_SECONDS}`": 120,
    "attributes.`Models`": 200,
    "attributes.`Source`": 120,
    "attributes.`Version`": 90,
    "duration": 80,
    "runDateAndNestInfo": 150,
}
ALWAYS_SHOWN = ("attributes.`Run Name`", "duration", "runDateAndNestInfo")

# Run tags that the table reads. The first makes it unfold the comparison above the run, where other
# runs stay folded; it says nothing about the run except that it has been evaluated.
UNFOLDED = {"mlflow.runType": "evaluation"}
COLOUR = "mlflow.runColor"


def address(experiment_id: str) -> str:
    """Return the address of the table of runs, relative to that of MLflow's pages."""
    return (
        f"#/experiments/{experiment_id}/runs?workflowType=machine_learning&viewStateShareKey={VIEW}"
    )


def experiment_tags(experiment_id: str) -> dict[str, str]:
    """Return the tags that make an experiment's pages useful."""
    # The times only order the list of views.
    state = json.dumps(_view_state())
    view = {"name": VIEW_NAME, "createdAt": 0, "updatedAt": 0, "state": state}
    note = f"{ABOUT} [Table of results]({address(experiment_id)})"
    return {**KIND_TAGS, NOTE: note, VIEW_TAG: json.dumps(view)}


def _view_state() -> dict[str, Any]:
    """Return what MLflow's page would save: sorted by time, runs are nested."""
    return {
        "searchFilter": "",
        "orderByKey": "attributes.start_time",
        "orderByAsc": False,
        "startTime": "ALL",
        "lifecycleFilter": "Active",
        "selectedColumns": [name for name in COLUMNS if name not in ALWAYS_SHOWN],
        "columnOrder": list(COLUMNS),
        "columnWidths": COLUMNS,
    }
