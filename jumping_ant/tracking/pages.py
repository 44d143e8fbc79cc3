"""How MLflow's pages present the experiment: a saved view, a description, an address.

By default MLflow shows no parameters and no metrics in its table of runs. Users choose the saved
view from the menu "Views" or open it by address.
"""

from jumping_ant.tracking import internals
from jumping_ant.tracking.records import AGGREGATE, EVALUATION, TRAIN_SECONDS

VIEW, VIEW_NAME = "agents", "Agents"
NOTE = "mlflow.note.content"
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


def address(experiment_id: str) -> str:
    """Return the address of the table of agents, relative to that of MLflow's pages."""
    return internals.view_address(experiment_id, VIEW)


def experiment_tags(experiment_id: str) -> dict[str, str]:
    """Return the tags that make an experiment's pages useful."""
    note = f"{ABOUT} [Table of results]({address(experiment_id)})"
    view = internals.saved_view(VIEW, VIEW_NAME, COLUMNS, f"tags.{AGGREGATE} LIKE '%'", RETURN)
    return internals.EXPERIMENT_KIND | {NOTE: note} | view
