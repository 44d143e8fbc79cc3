"""Comparison of the agents: the numbers of `results/comparison.json` and `results/plots/`.

The statistics are those of `jumping_ant.comparison.estimates`: one observation per seed.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.comparison.estimates import (
    Estimate,
    aggregate_curves,
    common_grid,
    estimate_iqm,
    probability_of_improvement,
)
from jumping_ant.comparison.results import AgentResults
from jumping_ant.experiment.curves import Unit, evaluations
from jumping_ant.looks.looks import looks
from jumping_ant.looks.naming import Family
from jumping_ant.params.blocks import CompareParams

Array = NDArray[np.float64]

FRONTS = {"env_steps": "pareto_steps", "train_seconds": "pareto_seconds"}  # by kind of cost


@dataclass(frozen=True)
class LearningCurve:
    """The return of an agent's policies during training, over its seeds; all are (num_points,)."""

    env_steps: Array  # simulated so far [control steps]
    seconds: Array  # of training so far, mean over seeds
    returns: Estimate  # interquartile mean over seeds, with its interval


def summarize(results: Mapping[str, AgentResults], params: CompareParams) -> dict[str, Any]:
    """Return the agents' figures and pairwise comparisons, as in `results/comparison.json`."""
    returns = {name: agent.quantities["return"] for name, agent in results.items()}
    pairs = {}
    for one, other in combinations(returns, 2):
        won = probability_of_improvement(returns[one], returns[other], params)
        # The reverse comparison reads the same table from the other side; it is no new experiment.
        lost = Estimate(1 - won.value, 1 - won.high, 1 - won.low)
        pairs[f"{one}>{other}"] = won.as_dict("p")
        pairs[f"{other}>{one}"] = lost.as_dict("p")
    ordered = (f"{one}>{other}" for one in returns for other in returns if one != other)
    equal = _equal_budgets(results, params.confidence)
    agents = {
        name: _summarize_agent(agent, params.confidence) | equal["agents"].get(name, {})
        for name, agent in results.items()
    }
    learners = {name: agents[name] for name, agent in results.items() if not agent.is_baseline}
    gains = {name: agent["return"]["iqm"] for name, agent in learners.items()}
    return {
        "agents": agents,
        "equal_steps": equal["equal_steps"],
        "equal_seconds": equal["equal_seconds"],
        **{front: pareto_front(_each(learners, cost), gains) for cost, front in FRONTS.items()},
        "probability_of_improvement": {pair: pairs[pair] for pair in ordered},
    }


def ranking(agents: Mapping[str, Any]) -> list[str]:
    """Return the names in a summary's `agents`, the highest interquartile mean return first."""
    return sorted(agents, key=lambda name: -agents[name]["return"]["iqm"])


def best_baseline(results: Mapping[str, AgentResults], agents: Mapping[str, Any]) -> str | None:
    """Return the baseline that returns most in a summary's `agents`, if there is any."""
    return next((name for name in ranking(agents) if results[name].is_baseline), None)


def pareto_front(costs: Mapping[str, float], gains: Mapping[str, float]) -> list[str]:
    """Return the agents that gain more than all others that cost no more, in the order of cost.

    Of agents equal in both, the first one is returned.
    """
    front: list[str] = []
    for name in sorted(costs, key=lambda name: (costs[name], -gains[name])):
        if not front or gains[name] > gains[front[-1]]:
            front.append(name)
    return front


def learning_curves(
    results: Mapping[str, AgentResults], params: CompareParams
) -> dict[str, LearningCurve]:
    """Return each agent's learning curve over its seeds.

    A baseline learns nothing: its curve is constant at its last evaluation, from the learners'
    first evaluation to their last one.
    """
    curves = {name: _learning_curve(agent, params.confidence) for name, agent in results.items()}
    learned = [curve for name, curve in curves.items() if not results[name].is_baseline]
    if not learned:
        return curves
    starts = min(curve.env_steps[0] for curve in learned), min(c.seconds[0] for c in learned)
    ends = max(curve.env_steps[-1] for curve in learned), max(c.seconds[-1] for c in learned)
    steps, seconds = np.array([starts, ends]).T
    for name, curve in curves.items():
        if results[name].is_baseline:
            level = [np.repeat(part[-1], 2) for part in vars(curve.returns).values()]
            curves[name] = LearningCurve(steps, seconds, Estimate(*level))
    return curves


def curve_rows(
    curves: Mapping[str, LearningCurve], families: Mapping[str, Family]
) -> list[dict[str, Any]]:
    """Return the learning curves as a tidy table for `dvc plots`, one row per point.

    Each row holds its agent's colour and line style, which the plots' template takes as they are.
    """
    drawn = looks(families)
    return [
        {
            "agent": name,
            "env_steps": float(curve.env_steps[i]),
            "seconds": float(curve.seconds[i]),
            "return_iqm": float(curve.returns.value[i]),
            "low": float(curve.returns.low[i]),
            "high": float(curve.returns.high[i]),
            "colour": drawn[name].colour,
            "line": drawn[name].line,
        }
        for name, curve in curves.items()
        for i in range(len(curve.env_steps))
    ]


def seed_rows(results: Mapping[str, AgentResults]) -> list[dict[str, Any]]:
    """Return every seed's evaluations as a tidy table, one row per evaluation."""
    return [
        {
            "agent": name,
            "seed": seed,
            "env_steps": int(steps),
            "seconds": float(seconds),
            "evaluation_return": float(value),
        }
        for name, agent in results.items()
        for seed, curve in agent.curves.items()
        for steps, seconds, value in zip(
            curve["env_steps"], curve["seconds"], curve["evaluation_return_mean"], strict=True
        )
        if not np.isnan(value)
    ]


def _each(agents: Mapping[str, Mapping[str, Any]], key: str) -> dict[str, float]:
    return {name: agent[key] for name, agent in agents.items()}


def _summarize_agent(agent: AgentResults, confidence: float) -> dict[str, Any]:
    """Return an agent's figures, of the seeds that have a value; a quantity of none is left out."""
    known = {name: values[~np.isnan(values)] for name, values in agent.quantities.items()}
    return {
        "seeds": len(agent.curves),
        **{name: describe(values, confidence) for name, values in known.items() if len(values)},
        "env_steps": int(agent.env_steps.max()),
        "train_seconds": float(agent.train_seconds.mean()),
    }


def describe(sample: Array, confidence: float) -> dict[str, float]:
    """Return the summary of one number per seed, with the interval of the interquartile mean."""
    return {
        **estimate_iqm(sample, confidence).as_dict("iqm"),
        "mean": float(sample.mean()),
        "worst": float(sample.min()),
        "best": float(sample.max()),
    }


def _return_at(
    agent: AgentResults, against: Unit, place: float, confidence: float
) -> dict[str, float] | None:
    """Describe the return after an amount of training; None if a seed was first evaluated later."""
    own = [evaluations(curve, against) for curve in agent.curves.values()]
    returns = [np.interp(place, *evaluated, left=np.nan) for evaluated in own]
    known = not np.isnan(returns).any()
    return describe(np.array(returns), confidence) if known else None


def _equal_budgets(results: Mapping[str, AgentResults], confidence: float) -> dict[str, Any]:
    """Return the smallest budgets among the learners, and each learner's return at them."""
    learners = {name: agent for name, agent in results.items() if not agent.is_baseline}
    if not learners:
        return {"equal_steps": None, "equal_seconds": None, "agents": {}}
    steps = float(min(agent.env_steps.min() for agent in learners.values()))
    seconds = float(min(agent.train_seconds.min() for agent in learners.values()))
    return {
        "equal_steps": steps,
        "equal_seconds": seconds,
        "agents": {
            name: {
                "return_at_equal_steps": _return_at(agent, "env_steps", steps, confidence),
                "return_at_equal_seconds": _return_at(agent, "seconds", seconds, confidence),
            }
            for name, agent in learners.items()
        },
    }


def _learning_curve(agent: AgentResults, confidence: float) -> LearningCurve:
    curves = agent.curves.values()
    evaluated = [evaluations(curve) for curve in curves]
    grid = common_grid([steps for steps, _ in evaluated])
    clocks = [np.interp(grid, curve["env_steps"], curve["seconds"]) for curve in curves]
    returns = aggregate_curves(grid, evaluated, confidence)
    return LearningCurve(grid, np.mean(clocks, axis=0), returns)
