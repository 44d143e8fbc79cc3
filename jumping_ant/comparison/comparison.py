"""Comparison of the agents: the numbers of `results/comparison.json` and `results/plots/`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.agents.families import Family
from jumping_ant.comparison.estimates import Estimate, estimate_iqm, probability_of_improvement
from jumping_ant.comparison.results import AgentResults
from jumping_ant.media.style import looks
from jumping_ant.params.blocks import CompareParams
from jumping_ant.training.curves import Unit, evaluations

Array = NDArray[np.float64]

# Keys of an agent in a summary: its cost, and its return at the smallest budget.
COSTS: dict[Unit, str] = {"env_steps": "cost_steps", "seconds": "train_seconds"}
EARLY: dict[Unit, str] = {
    "env_steps": "return_at_equal_steps",
    "seconds": "return_at_equal_seconds",
}


@dataclass(frozen=True)
class LearningCurve:
    """The return of an agent's policies during training, over its seeds; all are (num_points,)."""

    trained: Array  # control steps so far
    returns: Estimate  # interquartile mean over seeds, with its interval


def summarize(
    results: Mapping[str, AgentResults], params: CompareParams, learned: float | None = None
) -> dict[str, Any]:
    """Return the agents' figures and pairwise comparisons, as in `results/comparison.json`.

    A seed has failed that does not return more than `learned`, if that is known.
    """
    returns = {name: agent.quantities["return"] for name, agent in results.items()}
    pairs = {}
    for one, other in combinations(returns, 2):
        won = probability_of_improvement(returns[one], returns[other], params)
        pairs[one, other] = won.as_dict("p")
        pairs[other, one] = Estimate(1 - won.value, 1 - won.high, 1 - won.low).as_dict("p")
    equal, early = at_equal_budgets(results, "env_steps", params.confidence)
    agents = {
        name: _summarize_agent(agent, params.confidence, learned) | early.get(name, {})
        for name, agent in results.items()
    }
    return {
        "agents": agents,
        "equal_steps": equal,
        "pareto_steps": front(results, agents, "env_steps"),
        "probability_of_improvement": {
            ">".join(pair): pairs[pair] for pair in permutations(returns, 2)
        },
    }


def ranking(agents: Mapping[str, Any]) -> list[str]:
    """Return the names in a summary's `agents`, the highest interquartile mean return first."""
    return sorted(agents, key=lambda name: -agents[name]["return"]["iqm"])


def best_baseline(results: Mapping[str, AgentResults], agents: Mapping[str, Any]) -> str | None:
    """Return the baseline that returns most in a summary's `agents`, if there is any."""
    return next((name for name in ranking(agents) if results[name].is_baseline), None)


def front(results: Mapping[str, AgentResults], agents: Mapping[str, Any], unit: Unit) -> list[str]:
    """Return the learners on the Pareto front of a summary's `agents`, in the order of cost."""
    learners = [name for name, agent in results.items() if not agent.is_baseline]
    costs = {name: agents[name][COSTS[unit]] for name in learners}
    return pareto_front(costs, {name: agents[name]["return"]["iqm"] for name in learners})


def pareto_front(costs: Mapping[str, float], gains: Mapping[str, float]) -> list[str]:
    """Return who gains more than all that cost no more, by cost; of equals the first."""
    front: list[str] = []
    for name in sorted(costs, key=lambda name: (costs[name], -gains[name])):
        if not front or gains[name] > gains[front[-1]]:
            front.append(name)
    return front


def learning_curves(
    results: Mapping[str, AgentResults], params: CompareParams
) -> dict[str, LearningCurve]:
    """Return each agent's learning curve over its seeds; one that ends early keeps its last value.

    A baseline learns nothing: its curve is constant at what it returns on the held-out episodes,
    from the learners' first evaluation to their last one.
    """
    curves, ends = {}, (0.0, 0.0)
    for name in (learners := [name for name, it in results.items() if not it.is_baseline]):
        evaluated = [evaluations(curve) for curve in results[name].curves.values()]
        grid = _common_grid([steps for steps, _ in evaluated])
        returns = np.stack([np.interp(grid, *curve) for curve in evaluated], axis=-1)
        curves[name] = LearningCurve(grid, estimate_iqm(returns, params.confidence))
    if learners:
        trained = [curve.trained for curve in curves.values()]
        ends = min(own[0] for own in trained), max(own[-1] for own in trained)
    for name in results.keys() - curves.keys():
        level = estimate_iqm(results[name].quantities["return"], params.confidence)
        flat = Estimate(*(np.repeat(part, 2) for part in vars(level).values()))
        curves[name] = LearningCurve(np.array(ends), flat)
    return {name: curves[name] for name in results}


def evaluation_rows(results: Mapping[str, AgentResults]) -> list[dict[str, Any]]:
    """Return every evaluation of each seed, as `jumping_ant.comparison.runs` reads them."""
    return [
        {"agent": name, "seed": seed, "step": int(step), "return": value}
        for name, agent in results.items()
        for seed, curve in agent.curves.items()
        for step, value in zip(*(own.tolist() for own in evaluations(curve)), strict=True)
    ]


def curve_rows(
    curves: Mapping[str, LearningCurve], families: Mapping[str, Family]
) -> list[dict[str, Any]]:
    """Return the learning curves as a tidy table for `dvc plots`, one row per point.

    Each row holds its agent's colour and line style, which the plots' template takes as they are.
    """
    columns = ("env_steps", "return_iqm", "low", "high")
    drawn = looks(families)
    return [
        {"agent": name}
        | dict(zip(columns, map(float, point), strict=True))
        | {"colour": drawn[name].colour, "line": drawn[name].line}
        for name, curve in curves.items()
        for point in zip(curve.trained, *vars(curve.returns).values(), strict=True)
    ]


def _common_grid(positions: Sequence[Array]) -> Array:
    """Return where to compare curves with points at increasing positions, (num_points,) each.

    That is at these positions if all agree. Otherwise at as many as the longest curve has, evenly
    spaced from where the last curve starts to where the last one ends.
    """
    if all(np.array_equal(one, positions[0]) for one in positions):
        return positions[0]
    start, end = max(one[0] for one in positions), max(one[-1] for one in positions)
    return np.linspace(start, end, max(map(len, positions)))


def _summarize_agent(
    agent: AgentResults, confidence: float, learned: float | None
) -> dict[str, Any]:
    """Return an agent's figures, of the seeds that have a value; a quantity of none is left out."""
    known = {name: values[~np.isnan(values)] for name, values in agent.quantities.items()}
    return {
        "seeds": len(agent.curves),
        **{name: describe(values, confidence) for name, values in known.items() if len(values)},
        "env_steps": (trained := int(agent.budgets("env_steps").max())),
        "cost_steps": trained + agent.validation_steps,
        **({} if learned is None else {"failed": int((known["return"] <= learned).sum())}),
    }


def at_equal_budgets(
    results: Mapping[str, AgentResults], unit: Unit, confidence: float
) -> tuple[float | None, dict[str, dict[str, Any]]]:
    """Return the smallest budget of a learner's seeds, and an entry of each learner's return there.

    Returns are read off the seeds' learning curves; None if a seed was first evaluated later.
    """
    learners = {name: agent for name, agent in results.items() if not agent.is_baseline}
    if not learners:
        return None, {}
    least = float(min(agent.budgets(unit).min() for agent in learners.values()))
    early = {}
    for name, agent in learners.items():
        evaluated = [evaluations(curve, unit) for curve in agent.curves.values()]
        returns = np.array([np.interp(least, *curve, left=np.nan) for curve in evaluated])
        known = not np.isnan(returns).any()
        early[name] = {EARLY[unit]: describe(returns, confidence) if known else None}
    return least, early


def describe(sample: Array, confidence: float) -> dict[str, float]:
    """Return the summary of one number per seed, with the interval of the interquartile mean."""
    return {
        **estimate_iqm(sample, confidence).as_dict("iqm"),
        "mean": float(sample.mean()),
        "worst": float(sample.min()),
        "best": float(sample.max()),
    }
