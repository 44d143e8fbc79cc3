"""What agents keep of their return under perturbations, and what they withstand.

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
from typing import Any

import numpy as np

from jumping_ant.comparison.estimates import Estimate, estimate_iqm
from jumping_ant.experiment.models import Params
from jumping_ant.sim.perturbations import NAMES, NONE, Array, Condition

HALF = 0.5

Returns = Mapping[Condition, Array]
"""An agent's mean return of every seed under each condition, (num_seeds,); `NONE` is the first."""


def margin(params: Params) -> float:
    """Return the smallest difference of practical size between returns of perturbed episodes.

    It is that of returns, in proportion to the length of the episodes.
    """
    share = params.robustness.episode_steps / params.env.max_episode_steps
    return share * params.compare.margins.returns


def kept(returns: Returns) -> dict[Condition, Array]:
    """Return what each seed keeps under each perturbation, (num_seeds,).

    NaN for a seed without a positive return where nothing is perturbed.
    """
    usual = np.where(returns[NONE] > 0, returns[NONE], np.nan)
    return {condition: own / usual for condition, own in returns.items() if condition != NONE}


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
    shares = kept(returns)
    played = [name for name in NAMES if any(name == own.perturbation for own in shares)]
    return {
        name: _under(
            {own: share for own, share in shares.items() if own.perturbation == name},
            returns,
            metronome,
            margin,
            confidence,
        )
        for name in played
    }


def _under(
    shares: Returns,
    returns: Returns,
    metronome: Returns | None,
    margin: float,
    confidence: float,
) -> dict[str, Any]:
    """Return the numbers of one perturbation."""
    levels = [condition.level for condition in shares]
    known = [share[~np.isnan(share)] for share in shares.values()]
    estimates = [estimate_iqm(own, confidence) if len(own) else None for own in known]
    middle = [_end(own, "value") for own in estimates]
    crossing = None
    if metronome is not None:
        is_behind = [metronome[own].mean() - returns[own].mean() > margin for own in shares]
        crossing = _from_on(is_behind, levels)
    return {
        "level": levels,
        "retention": middle,
        "low": [_end(own, "low") for own in estimates],
        "high": [_end(own, "high") for own in estimates],
        "half": _from_on([own is not None and own < HALF for own in middle], levels),
        "crossing": crossing,
        "worst": min((own for own in middle if own is not None), default=None),
    }


def _from_on(does: Sequence[bool], levels: Sequence[float]) -> float | None:
    """Return the mildest level from which on all do, if any."""
    last_without = max((place for place, own in enumerate(does) if not own), default=-1)
    return levels[last_without + 1] if last_without + 1 < len(levels) else None


def _end(estimate: Estimate | None, name: str) -> float | None:
    """Return a number of an estimate, None where no seed has one."""
    return None if estimate is None else float(getattr(estimate, name))
