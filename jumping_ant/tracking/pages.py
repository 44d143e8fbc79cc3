"""How MLflow's pages present the experiment: a saved view, a description, an address.

By default MLflow shows no parameters and no metrics in its table of runs. Users choose the saved
view from the menu "Views" or open it by address. MLflow documents neither the tags nor the
address; they are checked against MLflow 3.17.2.
"""

import json

from jumping_ant.tracking.records import AGGREGATE, EVALUATION, TRAIN_SECONDS

# Tags that the pages read. This one decides which pages an experiment has.
EXPERIMENT_KIND = {"mlflow.experimentKind": "custom_model_development"}
RUN_COLOUR = "mlflow.runColor"
# Unfolds the comparison above the run, which says nothing about the run except that it has been
# evaluated.
UNFOLDED = {"mlflow.runType": "evaluation"}
NOTE = "mlflow.note.content"

VIEW, VIEW_NAME = "agents", "Agents"
ABOUT = "Agents that teach a robot of MuJoCo to jump: one run per agent and seed."
RETURN = f"metrics.`{EVALUATION}return`"
# Of the table of agents, each with all its seeds.
COLUMNS = (
    "tags.`agent`",
    RETURN,
    *(f"metrics.`{EVALUATION}return_{part}`" for part in ("low", "high", "worst")),
    *(f"metrics.`{EVALUATION}{name}`" for name in ("apex", "flight", "fluidity")),
    f"metrics.`{TRAIN_SECONDS}`",
)
ALWAYS_SHOWN = ("attributes.`Run Name`", "duration", "runDateAndNestInfo")  # first, last, last


def address(experiment_id: str) -> str:
    """Return the address of the table of agents, relative to that of MLflow's pages."""
    query = f"workflowType=machine_learning&viewStateShareKey={VIEW}"
    return f"#/experiments/{experiment_id}/runs?{query}"


def experiment_tags(experiment_id: str) -> dict[str, str]:
    """Return the tags that make an experiment's pages useful."""
    first, *last = ALWAYS_SHOWN
    state = {
        "searchFilter": f"tags.{AGGREGATE} LIKE '%'",
        "orderByKey": RETURN,
        "orderByAsc": False,
        "startTime": "ALL",
        "lifecycleFilter": "Active",
        "selectedColumns": COLUMNS,
        "columnOrder": [first, *COLUMNS, *last],
        "columnWidths": {},  # the page looks each column up in it
    }
    # The times only order the list of views.
    view = {"name": VIEW_NAME, "createdAt": 0, "updatedAt": 0, "state": json.dumps(state)}
    note = f"{ABOUT} [Table of results]({address(experiment_id)})"
    shared = {f"mlflow.sharedViewState.{VIEW}": json.dumps(view)}
    return EXPERIMENT_KIND | {NOTE: note} | shared
