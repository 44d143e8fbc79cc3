"""What training took in seconds: the numbers of `results/speed.json`."""

from collections.abc import Mapping
from typing import Any

from jumping_ant.comparison import comparison, summaries
from jumping_ant.comparison.claims import timing, verdicts
from jumping_ant.comparison.claims.timing import Scaling
from jumping_ant.comparison.results import AgentResults
from jumping_ant.params.model import Params


def summarize(
    params: Params,
    results: Mapping[str, AgentResults],
    compared: Mapping[str, Any],
    scaling: Scaling,
) -> dict[str, Any]:
    """Return the agents' seconds, what they returned after equal ones, and the claims on them.

    Args:
        params: All parameters.
        results: Of each agent, with seconds in its curves.
        compared: The content of `results/comparison.json`, which has the returns.
        scaling: What a unit of each agent's training takes, by number of threads.
    """
    equal, early = comparison.at_equal_budgets(results, "seconds", params.compare.confidence)
    agents = {
        name: {"train_seconds": float(agent.budgets("seconds").mean())} | early.get(name, {})
        for name, agent in results.items()
    }
    together = summaries.merged(compared, {"agents": agents})["agents"]
    episodes = params.training.evaluation_episodes
    return {
        "agents": agents,
        "equal_seconds": equal,
        "pareto_seconds": comparison.front(results, together, "seconds"),
        "claims": verdicts.check(results, params.compare, episodes, timing.table(scaling)),
    }
