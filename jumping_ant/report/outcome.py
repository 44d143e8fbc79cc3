"""The outcome of a comparison, and what its charts share, whichever library draws them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from jumping_ant.agents.families import Family
from jumping_ant.comparison import comparison
from jumping_ant.comparison.comparison import LearningCurve
from jumping_ant.comparison.results import AgentResults
from jumping_ant.media import style
from jumping_ant.media.style import Look
from jumping_ant.params.model import Params

RETURN = "Return per held-out episode"
BUDGET = "Training budget [control steps]"
LEARNING = "Return per evaluation episode"
LONG_AXIS = 20.0  # values that differ by more than this factor get a logarithmic axis


@dataclass(frozen=True)
class Outcome:
    """The agents' results, in the order in which they are shown, and their comparison."""

    params: Params
    results: Mapping[str, AgentResults]
    summary: Mapping[str, Any]  # as in `results/comparison.json`

    @property
    def agents(self) -> Mapping[str, Any]:
        """The summary of each agent."""
        return self.summary["agents"]

    @cached_property
    def families(self) -> dict[str, Family]:
        """Each agent's family."""
        return {name: agent.family for name, agent in self.results.items()}

    @cached_property
    def looks(self) -> dict[str, Look]:
        """Each agent's look, which depends on the order of `params.yaml`."""
        return style.looks({name: self.families[name] for name in self.params.agents})

    @cached_property
    def curves(self) -> dict[str, LearningCurve]:
        """Each agent's learning curve."""
        return comparison.learning_curves(self.results, self.params.compare)

    @cached_property
    def ranked(self) -> list[str]:
        """The agents, the one that returns most first."""
        return comparison.ranking(self.agents)

    @cached_property
    def learners(self) -> list[str]:
        """The agents that are no baselines."""
        return [name for name, agent in self.results.items() if not agent.is_baseline]

    @cached_property
    def best_baseline(self) -> str | None:
        """The baseline that returns most, if there is any."""
        return comparison.best_baseline(self.results, self.agents)

    @property
    def is_crowded(self) -> bool:
        """Whether there are too many learners for one panel, so that families are apart."""
        return style.is_crowded(self.families)


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
