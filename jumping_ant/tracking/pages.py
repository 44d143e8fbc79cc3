"""How MLflow's pages present the experiment: a saved view, a description, an address.

By default MLflow shows no parameters and no metrics in its table of runs. Users choose saved views
from the menu "Views" or open them by address.
"""

from jumping_ant.tracking import internals
from jumping_ant.tracking.records import (
    AGGREGATE,
    EVALUATION,
    FINAL_RETURN,
    TRAIN_SECONDS,
    VALIDATION_RETURN,
)

VIEW, VIEW_NAME = "agents", "Agents"
SEEDS_VIEW, SEEDS_VIEW_NAME = "comparison", "Agents and seeds"
NOTE = "mlflow.note.content"
ABOUT = "Agents that teach a robot of MuJoCo to jump: one run per agent and seed."

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
# Of the table of agents, each with all its seeds.
RETURN = f"metrics.`{EVALUATION}return`"
AGENT_COLUMNS = {
    "attributes.`Run Name`": 270,
    "tags.`agent`": 110,
    RETURN: 145,
    f"metrics.`{EVALUATION}return_low`": 175,
    f"metrics.`{EVALUATION}return_high`": 175,
    f"metrics.`{EVALUATION}return_worst`": 180,
    f"metrics.`{EVALUATION}apex`": 140,
    f"metrics.`{EVALUATION}flight`": 140,
    f"metrics.`{EVALUATION}fluidity`": 150,
    f"metrics.`{TRAIN_SECONDS}`": 120,
    "duration": 80,
    "runDateAndNestInfo": 150,
}
ALWAYS_SHOWN = ("attributes.`Run Name`", "duration", "runDateAndNestInfo")


def address(experiment_id: str, view: str = VIEW) -> str:
    """Return the address of a table of runs, relative to that of MLflow's pages."""
    return internals.view_address(experiment_id, view)


def experiment_tags(experiment_id: str) -> dict[str, str]:
    """Return the tags that make an experiment's pages useful."""
    seeds = address(experiment_id, SEEDS_VIEW)
    note = f"{ABOUT} [Table of results]({address(experiment_id)}), [of every seed]({seeds})"
    agents = internals.saved_view(
        VIEW, VIEW_NAME, AGENT_COLUMNS, ALWAYS_SHOWN, f"tags.{AGGREGATE} LIKE '%'", RETURN
    )
    every = internals.saved_view(SEEDS_VIEW, SEEDS_VIEW_NAME, COLUMNS, ALWAYS_SHOWN)
    return internals.EXPERIMENT_KIND | {NOTE: note} | agents | every
