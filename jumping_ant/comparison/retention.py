"""What agents keep of their return under perturbations: `results/robustness.json`.

At each level of a perturbation a seed keeps the return there over its return without any.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from jumping_ant.comparison.estimates import estimate_iqm
from jumping_ant.comparison.results import AgentResults
from jumping_ant.evaluation import perturbed
from jumping_ant.params.model import Params
from jumping_ant.sim.levels import LEVELS
from jumping_ant.sim.perturbations import NAMES, NONE, SENSING, Array, Condition

Returns = Mapping[Condition, Array]
"""An agent's mean return of every seed under each condition, (num_seeds,); `NONE` is the first."""

HALF = 0.5
GROUPS: dict[str, Collection[str]] = {  # of perturbations, by the quantity that averages them
    "retention_world": [name for name in NAMES if name not in SENSING],
    "retention_senses": SENSING,
}


def read(root: Path, params: Params) -> dict[str, Returns]:
    """Read the returns of the agents that play under perturbations."""
    played = {name: perturbed.read(root, params, name) for name in params.agents}
    return {name: returns for name, returns in played.items() if returns}


def with_groups(
    results: Mapping[str, AgentResults], played: Mapping[str, Returns]
) -> dict[str, AgentResults]:
    """Return the agents with what their seeds keep on average over each group's levels."""

    def quantities(returns: Returns) -> dict[str, Array]:
        shares = kept(returns)
        return {
            group: np.mean([own for it, own in shares.items() if it.perturbation in names], axis=0)
            for group, names in GROUPS.items()
        }

    grouped = {name: quantities(returns) for name, returns in played.items()}
    return {
        name: replace(agent, quantities=agent.quantities | grouped.get(name, {}))
        for name, agent in results.items()
    }


def summarize(played: Mapping[str, Returns], confidence: float) -> dict[str, Any]:
    """Return what each agent keeps under each perturbation."""
    return {
        "perturbations": [name for name, row in LEVELS.items() if row.values],
        "agents": {name: withstood(returns, confidence) for name, returns in played.items()},
    }


def withstood(returns: Returns, confidence: float) -> dict[str, dict[str, Any]]:
    """Return what an agent keeps, by perturbation, with the keys of docs/measures-and-claims.md."""
    shares = kept(returns)
    by_name = {}
    for name in dict.fromkeys(condition.perturbation for condition in shares):
        conditions = [condition for condition in shares if condition.perturbation == name]
        levels = [condition.level for condition in conditions]
        numbers = [_interval(shares[condition], confidence) for condition in conditions]
        middle = [one["retention"] for one in numbers]
        by_name[name] = {
            "level": levels,
            **{key: [one[key] for one in numbers] for key in ("retention", "low", "high")},
            "half": _from_on([share is not None and share < HALF for share in middle], levels),
            "worst": min((share for share in middle if share is not None), default=None),
        }
    return by_name


def kept(returns: Returns) -> dict[Condition, Array]:
    """Return what each seed keeps under each perturbation, (num_seeds,).

    NaN for a seed without a positive return where nothing is perturbed.
    """
    usual = np.where(returns[NONE] > 0, returns[NONE], np.nan)
    return {condition: own / usual for condition, own in returns.items() if condition != NONE}


def _interval(shares: Array, confidence: float) -> Mapping[str, float | None]:
    """Return the interquartile mean of what seeds keep with its interval; None without a seed."""
    known = shares[~np.isnan(shares)]
    if not len(known):
        return dict.fromkeys(("retention", "low", "high"))
    return estimate_iqm(known, confidence).as_dict("retention")


def _from_on(does: Sequence[bool], levels: Sequence[float]) -> float | None:
    """Return the mildest level from which on all do, if any."""
    last_without = max((place for place, own in enumerate(does) if not own), default=-1)
    return levels[last_without + 1] if last_without + 1 < len(levels) else None
