"""What charts share, whichever library draws them: labels, kinds of axes, kinds of agents."""

from collections.abc import Mapping, Sequence

import numpy as np

from jumping_ant.agents.families import Family
from jumping_ant.comparison.results import AgentResults

RETURN = "Return per held-out episode"
BUDGET = "Training budget [control steps]"
LEARNING = "Return per evaluation episode"
LONG_AXIS = 20.0  # values that differ by more than this factor get a logarithmic axis


def is_long(values: Sequence[float]) -> bool:
    """Return whether values are all at least 1 and too far apart for a linear axis."""
    return bool(values) and min(values) >= 1 and max(values) > LONG_AXIS * min(values)


def log_ends(times: Sequence[np.ndarray]) -> tuple[float, float] | None:
    """Return the ends of a logarithmic axis of curves' times, None if a linear one has room."""
    positive = [curve[curve > 0] for curve in times if (curve > 0).any()]
    budgets = [float(curve[-1]) for curve in positive]
    if not is_long(budgets):
        return None
    return 0.8 * min(float(curve[0]) for curve in positive), 1.2 * max(budgets)


def families(results: Mapping[str, AgentResults]) -> dict[str, Family]:
    """Return each agent's family."""
    return {name: agent.family for name, agent in results.items()}


def learners(results: Mapping[str, AgentResults]) -> list[str]:
    """Return the agents that are no baselines."""
    return [name for name, agent in results.items() if not agent.is_baseline]
