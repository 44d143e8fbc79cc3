"""How MLflow's pages present the experiment: saved views, a description, an address.

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

RETURN = f"metrics.`{EVALUATION}return`"
QUANTITIES = [f"metrics.`{EVALUATION}{name}`" for name in ("apex", "flight", "fluidity")]
COLUMNS = (
    "tags.`agent`",
    "tags.`seed`",
    RETURN,
    f"metrics.`{VALIDATION_RETURN}`",
    f"metrics.`{FINAL_RETURN}`",
    *QUANTITIES,
    f"metrics.`{TRAIN_SECONDS}`",
    "attributes.`Models`",
    "attributes.`Source`",
    "attributes.`Version`",
)
# Of the table of agents, each with all its seeds.
AGENT_COLUMNS = (
    "tags.`agent`",
    RETURN,
    *(f"metrics.`{EVALUATION}return_{part}`" for part in ("low", "high", "worst")),
    *QUANTITIES,
    f"metrics.`{TRAIN_SECONDS}`",
)


def address(experiment_id: str, view: str = VIEW) -> str:
    """Return the address of a table of runs, relative to that of MLflow's pages."""
    return internals.view_address(experiment_id, view)


def experiment_tags(experiment_id: str) -> dict[str, str]:
    """Return the tags that make an experiment's pages useful."""
    seeds = address(experiment_id, SEEDS_VIEW)
    note = f"{ABOUT} [Table of results]({address(experiment_id)}), [of every seed]({seeds})"
    condition = f"tags.{AGGREGATE} LIKE '%'"
    agents = internals.saved_view(VIEW, VIEW_NAME, AGENT_COLUMNS, condition, RETURN)
    every = internals.saved_view(SEEDS_VIEW, SEEDS_VIEW_NAME, COLUMNS)
    return internals.EXPERIMENT_KIND | {NOTE: note} | agents | every
