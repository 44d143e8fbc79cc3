"""What training took in seconds: the numbers and claims of `results/speed.json`.

They are statements on a machine, and its claims are a family of their own: corrected with all
others, they would make every verdict depend on a clock.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.comparison import claims, comparison
from jumping_ant.comparison.results import AgentResults, merged
from jumping_ant.params.claims import Claim
from jumping_ant.params.model import Params

Scaling = Mapping[str, Mapping[int, NDArray[np.float64]]]
"""By agent, the time of a unit of training [s], (num_seeds,), by number of threads; {} if not
timed."""


def summarize(
    params: Params,
    asked: Sequence[Claim],
    results: Mapping[str, AgentResults],
    compared: Mapping[str, Any],
    scaling: Scaling,
) -> dict[str, Any]:
    """Return the agents' seconds, what they returned after equal ones, and the claims on them.

    Args:
        params: All parameters.
        asked: All claims.
        results: Of each agent, with seconds in its curves.
        compared: The content of `results/comparison.json`, which has the returns.
        scaling: What a unit of each agent's training takes, by number of threads.
    """
    equal, early = comparison.at_equal_budgets(results, "seconds", params.compare.confidence)
    agents = {
        name: {"train_seconds": float(agent.budgets("seconds").mean())} | early.get(name, {})
        for name, agent in results.items()
    }
    together = merged(compared, {"agents": agents})["agents"]
    timed = {name: _with_seconds(agent, scaling[name]) for name, agent in results.items()}
    learned = claims.out_of_luck(results.values(), params.training.evaluation_episodes)
    return {
        "agents": agents,
        "equal_seconds": equal,
        "pareto_seconds": comparison.front(results, together, "seconds"),
        **claims.judge(claims.on_seconds(asked), timed, params.compare, learned),
    }


def _with_seconds(agent: AgentResults, seconds: Mapping[int, NDArray[np.float64]]) -> AgentResults:
    """Return an agent with the quantities of each seed that a clock tells."""
    more = {}
    if not agent.is_baseline:
        more["seconds_per_step"] = agent.budgets("seconds") / agent.budgets("env_steps")
    if len(seconds) > 1:
        more["speed_up"] = seconds[1] / seconds[max(seconds)]
    return replace(agent, quantities=agent.quantities | more)
