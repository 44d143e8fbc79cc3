"""What training took in seconds: the numbers of `results/speed.json`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jumping_ant.comparison import comparison
from jumping_ant.comparison.claims import verdicts
from jumping_ant.comparison.results import AgentResults
from jumping_ant.experiment import scaling_table, summaries
from jumping_ant.experiment.models import Params
from jumping_ant.speed import claims


def summarize(
    root: Path, params: Params, results: Mapping[str, AgentResults], compared: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the agents' seconds, what they returned after equal ones, and the claims on them.

    Args:
        root: The project's folder, with the agents' `scaling.csv`.
        params: All parameters.
        results: Of each agent, with seconds in its curves.
        compared: The content of `results/comparison.json`, which has the returns.
    """
    equal, early = comparison.at_equal_budgets(results, "seconds", params.compare.confidence)
    agents = {
        name: {"train_seconds": float(agent.budgets("seconds").mean())} | early.get(name, {})
        for name, agent in results.items()
    }
    together = summaries.merged(compared, {"agents": agents})["agents"]
    family = claims.table({name: scaling_table.read(root, params, name) for name in results})
    episodes = params.training.evaluation_episodes
    return {
        "agents": agents,
        "equal_seconds": equal,
        "pareto_seconds": comparison.front(results, together, "seconds"),
        "claims": verdicts.check(results, params.compare, episodes, family),
    }
