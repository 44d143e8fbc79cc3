"""The claims on perturbed episodes, fixed in docs/measures-and-claims.md; a family of their own."""

from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np

from jumping_ant.comparison.claims import findings
from jumping_ant.comparison.claims.evidence import Case, Compare
from jumping_ant.comparison.claims.field import Field, pairs
from jumping_ant.comparison.claims.findings import Finding, Sample
from jumping_ant.comparison.claims.statements import Row, Table
from jumping_ant.params.model import Params
from jumping_ant.sim.levels import LEVELS
from jumping_ant.sim.perturbations import NAMES, NONE, SENSING, Array, Condition

Returns = Mapping[Condition, Array]
"""An agent's mean return of every seed under each condition, (num_seeds,); `NONE` is the first."""
Played = Mapping[str, Returns]
"""What each agent returns under each condition."""

SEVERE = 3  # levels of a perturbation, the last ones, that the claims on it average


def table(params: Params, played: Played) -> Table:
    """Return which agents, in the order of their labels in the texts, and the claims on them."""
    severe = {name: LEVELS[name].values[-SEVERE:] for name in SENSING if LEVELS[name].values}
    world = [name for name in NAMES if name not in SENSING]
    return (
        (Field.beside_metronome, (
            *(
                Row(None, f"With {name.replace('_', ' ')} of {own[0]:g} to {own[-1]:g}, {{1}} "
                    "overtakes {0}: it returns more without looking at the robot.",
                    overtakes(params, played, [Condition(name, float(level)) for level in own]))
                for name, own in severe.items()
            ),
            Row(None, "Where body, floor and forces are others, looking at the robot helps: {0} "
                "keeps more of its return than {1}.", keeps_more(played, world, findings.paired)),
        )),
        (pairs("pgpe", "sac dqn"), (
            Row(9, "{0} is robust: under perturbations, it keeps more of its return than {1}.",
                keeps_more(played, NAMES, findings.independent)),
        )),
    )  # fmt: skip


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


def overtakes(params: Params, played: Played, conditions: Sequence[Condition]) -> Compare:
    """Ask whether the second agent returns more than the first, on average over conditions.

    Seeds of both play the same starts, so they are paired (`findings.paired`).
    """
    size = margin(params)

    def compare(case: Case) -> Finding | None:
        if not all(played[agent.name] for agent in case.agents):
            return None
        own, other = case.samples(
            lambda agent: Sample(
                agent.label, np.mean([played[agent.name][one] for one in conditions], axis=0)
            )
        )
        return findings.paired("Return", other, own, case.params, (-size, size))

    return compare


def keeps_more(played: Played, names: Collection[str], compared: Callable[..., Finding]) -> Compare:
    """Ask whether the first agent keeps more than the second.

    Of what is kept, the mean over all levels of some perturbations.

    Args:
        played: What each agent returns under each condition.
        names: The perturbations.
        compared: The test: `findings.paired`, as agents play the same starts, or
            `findings.independent`.
    """

    def shares(name: str) -> list[Array]:
        returns = played[name]
        found = kept(returns) if returns else {}
        return [share for condition, share in found.items() if condition.perturbation in names]

    def compare(case: Case) -> Finding | None:
        if not all(shares(agent.name) for agent in case.agents):
            return None
        samples = case.samples(
            lambda agent: Sample(agent.label, np.mean(shares(agent.name), axis=0))
        )
        return compared("Share of the return that is kept", *samples, case.params)

    return compare
