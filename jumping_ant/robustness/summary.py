"""What all agents withstand: the content of `results/robustness.json`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jumping_ant.comparison.claims import verdicts
from jumping_ant.comparison.claims.field import Field
from jumping_ant.comparison.results import AgentResults
from jumping_ant.experiment.models import Params
from jumping_ant.robustness import claims, retention, table
from jumping_ant.robustness.retention import Returns
from jumping_ant.sim.perturbations import NONE, Array, Condition


def summarize(root: Path, params: Params, results: Mapping[str, AgentResults]) -> dict[str, Any]:
    """Return what each agent keeps under each perturbation, and the claims on it.

    Args:
        root: The project's folder, with the tables of perturbed episodes.
        params: All parameters.
        results: Of each agent in undisturbed episodes.
    """
    played = {name: table.read(root, params, name) for name in results}
    field = Field(list(results.values()), params.training.evaluation_episodes)
    agents = {}
    for name, agent in results.items():
        if not played[name]:
            continue
        metronome = None if agent.is_baseline else field.metronome(agent)
        beside = played[metronome.name] if metronome else None
        agents[name] = retention.withstood(
            played[name], beside, retention.margin(params), params.compare.confidence
        )
    levels = params.robustness.perturbations.model_dump()
    return {
        "filmed": _filmed(params, results, field, played, agents),
        "perturbations": [name for name in levels if levels[name]],
        "agents": agents,
        "claims": verdicts.check(
            results,
            params.compare,
            params.training.evaluation_episodes,
            claims.table(params, played),
        ),
    }


def _filmed(
    params: Params,
    results: Mapping[str, AgentResults],
    field: Field,
    played: Mapping[str, Returns],
    agents: Mapping[str, Any],
) -> dict[str, Any]:
    """Return who is filmed, under which condition, and which seed.

    The best learner with a metronome, and that, at the level from which on the metronome is ahead
    by more than the margin, or the most severe one; the seed whose lead is closest to the mean, by
    which the metronome is ahead. Without such a pair, or a perturbation, it is the best agent,
    undisturbed.
    """
    best = sorted(results, key=lambda name: -results[name].quantities["return"].mean())
    name, seeds = params.robustness.filmed, params.seeds
    for learner in best:
        metronome = None if results[learner].is_baseline else field.metronome(results[learner])
        if name is None or metronome is None:
            continue
        own = agents[learner][name]
        condition = Condition(
            name, own["level"][-1] if own["crossing"] is None else own["crossing"]
        )
        leads = played[metronome.name][condition] - played[learner][condition]
        usual = int(np.abs(leads - leads.mean()).argmin())
        returns = {own: played[own][condition] for own in (learner, metronome.name)}
        return _film(returns, condition, seeds[usual])
    (alone, *_) = best
    return _film({alone: results[alone].quantities["return"]}, NONE, seeds[0])


def _film(returns: Mapping[str, Array], condition: Condition, seed: int) -> dict[str, Any]:
    """Return what a film shows, with the mean over seeds of each agent's returns."""
    agents = {name: float(own.mean()) for name, own in returns.items()}
    return {"agents": agents, **condition._asdict(), "seed": seed}
