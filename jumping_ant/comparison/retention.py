"""What agents keep of their return under perturbations: `results/robustness.json`.

At each level of a perturbation a seed keeps the return there over its return without any. Three
numbers tell what an agent withstands. Two of them are levels, each the mildest one from which on,
at all more severe levels, too,

- `half`: the interquartile mean over seeds of what they keep is below one half;
- `crossing`: a metronome, which does not look at the robot, returns more on average from the same
  starts, by more than the margin (after Raffin et al. 2024, "An open-loop baseline for
  reinforcement learning locomotion tasks"). It is not tested: the claims on perturbed episodes are.

None stands where no level does it. The third, `worst`, is the least that is kept at any level.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jumping_ant.comparison.claims import robustness, verdicts
from jumping_ant.comparison.claims.field import Field
from jumping_ant.comparison.claims.robustness import Returns
from jumping_ant.comparison.estimates import estimate_iqm
from jumping_ant.comparison.results import AgentResults
from jumping_ant.evaluation import perturbed_table
from jumping_ant.params.model import Params
from jumping_ant.sim.levels import LEVELS

HALF = 0.5


def summarize(root: Path, params: Params, results: Mapping[str, AgentResults]) -> dict[str, Any]:
    """Return what each agent keeps under each perturbation, and the claims on it.

    Args:
        root: The project's folder, with the tables of perturbed episodes.
        params: All parameters.
        results: Of each agent in undisturbed episodes.
    """
    played = {name: perturbed_table.read(root, params, name) for name in results}
    episodes = params.training.evaluation_episodes
    field = Field(list(results.values()), episodes)
    margin, confidence = robustness.margin(params), params.compare.confidence
    agents = {}
    for name, agent in results.items():
        if played[name]:
            metronome = None if agent.is_baseline else field.metronome(agent)
            beside = played[metronome.name] if metronome else None
            agents[name] = withstood(played[name], beside, margin, confidence)
    family = robustness.table(params, played)
    return {
        "perturbations": [name for name, row in LEVELS.items() if row.values],
        "agents": agents,
        "claims": verdicts.check(results, params.compare, episodes, family),
    }


def withstood(
    returns: Returns, metronome: Returns | None, margin: float, confidence: float
) -> dict[str, dict[str, Any]]:
    """Return what an agent keeps and withstands, by perturbation.

    Args:
        returns: The agent's.
        metronome: Those of the metronome beside it, if there is one.
        margin: By more than this the metronome has to be ahead.
        confidence: Of the intervals of what is kept.
    """
    shares = robustness.kept(returns)
    found = {}
    for name in dict.fromkeys(condition.perturbation for condition in shares):
        own = [condition for condition in shares if condition.perturbation == name]
        levels = [condition.level for condition in own]
        numbers = [_interval(shares[condition], confidence) for condition in own]
        middle = [one["retention"] for one in numbers]
        crossing = None
        if metronome is not None:
            leads = [metronome[one].mean() - returns[one].mean() for one in own]
            crossing = _from_on([lead > margin for lead in leads], levels)
        found[name] = {
            "level": levels,
            **{key: [one[key] for one in numbers] for key in ("retention", "low", "high")},
            "half": _from_on([share is not None and share < HALF for share in middle], levels),
            "crossing": crossing,
            "worst": min((share for share in middle if share is not None), default=None),
        }
    return found


def _interval(shares: np.ndarray, confidence: float) -> Mapping[str, float | None]:
    """Return the interquartile mean of what seeds keep, and its interval; None without a seed."""
    known = shares[~np.isnan(shares)]
    if not len(known):
        return dict.fromkeys(("retention", "low", "high"))
    return estimate_iqm(known, confidence).as_dict("retention")


def _from_on(does: Sequence[bool], levels: Sequence[float]) -> float | None:
    """Return the mildest level from which on all do, if any."""
    last_without = max((place for place, own in enumerate(does) if not own), default=-1)
    return levels[last_without + 1] if last_without + 1 < len(levels) else None
