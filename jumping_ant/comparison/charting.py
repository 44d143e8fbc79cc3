"""What charts show, whichever library draws them: labels, kinds of axes, numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jumping_ant.comparison import comparison
from jumping_ant.comparison.results import AgentResults
from jumping_ant.experiment.curves import Unit
from jumping_ant.looks.families import Family
from jumping_ant.looks.style import percent, percents

RETURN = "Return per held-out episode"
BUDGETS: dict[Unit, str] = {"env_steps": "Training budget [control steps]"}
LEARNING = "Return per evaluation episode"
BEHAVIOUR = {  # measures of how an agent jumps
    "apex": "Apex of a jump [m]",
    "flight": "Share of time in flight",
    "fluidity": "Fluidity (closer to 0 is more fluid)",
    "jumps": "Jumps per episode",
}
WINNER, LOSER = "This one returns more ...", "... than this one"

LONG_AXIS = 20.0  # values that differ by more than this factor get a logarithmic axis
MOST_IN_A_WIDE_MATRIX = 8  # agents whose pairs have room for their intervals


@dataclass(frozen=True)
class Sample:
    """A sample in a claim: a value for each seed, and whether the seed got there."""

    label: str
    values: Sequence[float | None]
    reached: Sequence[bool]


def is_long(values: Sequence[float]) -> bool:
    """Return whether values are all at least 1 and too far apart for a linear axis."""
    return bool(values) and min(values) >= 1 and max(values) > LONG_AXIS * min(values)


def has_room(num_agents: int) -> bool:
    """Return whether a matrix of so many agents has room for intervals."""
    return num_agents <= MOST_IN_A_WIDE_MATRIX


def log_ends(times: Sequence[np.ndarray]) -> tuple[float, float] | None:
    """Return the ends of a logarithmic axis of curves' times, None if a linear one has room."""
    known = [own[own > 0] for own in times if (own > 0).any()]
    budgets = [float(own[-1]) for own in known]
    if not is_long(budgets):
        return None
    return 0.8 * min(float(own[0]) for own in known), 1.2 * max(budgets)


def families(results: Mapping[str, AgentResults]) -> dict[str, Family]:
    """Return each agent's family."""
    return {name: agent.family for name, agent in results.items()}


def learners(results: Mapping[str, AgentResults]) -> list[str]:
    """Return the agents that are no baselines."""
    return [name for name, agent in results.items() if not agent.is_baseline]


def front(
    results: Mapping[str, AgentResults], summary: Mapping[str, Any], unit: Unit
) -> tuple[list[float], list[float]]:
    """Return the costs and returns on a Pareto front, which ends at the learners' greatest cost."""
    agents, names = summary["agents"], summary[comparison.FRONTS[unit]]
    cost = comparison.COSTS[unit]
    costs = [agents[name][cost] for name in names]
    returns = [agents[name]["return"]["iqm"] for name in names]
    most = max(agents[name][cost] for name in learners(results))
    return [*costs, most], [*returns, returns[-1]]


def duels(
    results: Mapping[str, AgentResults], summary: Mapping[str, Any]
) -> tuple[list[str], list[list[Mapping[str, float] | None]]]:
    """Return the agents' labels, the best first, and each one's chance (a row) to beat each."""
    ranked = comparison.ranking(summary["agents"])
    pairs = summary["probability_of_improvement"]
    chances = [[pairs.get(f"{one}>{other}") for other in ranked] for one in ranked]
    return [results[name].label for name in ranked], chances


def chance_text(
    chance: Mapping[str, float] | None, with_interval: bool, separator: str = "\n"
) -> str:
    """Return a chance in per cent, with its interval if it has one; empty for none."""
    if chance is None:
        return ""
    if not with_interval or chance["low"] == chance["high"]:
        return percent(chance["p"])
    return f"{percent(chance['p'])}{separator}{percents(chance['low'], chance['high'])}"


def samples(plot: Mapping[str, Any]) -> list[Sample]:
    """Return the samples of a claim's `plot`, of which some may say which seeds got there."""
    reached = plot.get("reached", {})
    return [
        Sample(label, values, reached.get(label, [True] * len(values)))
        for label, values in plot["values"].items()
    ]
