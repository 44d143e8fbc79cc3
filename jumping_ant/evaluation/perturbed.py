"""Which perturbed episodes an agent plays."""

from collections.abc import Iterator
from typing import NamedTuple

from jumping_ant.agents.catalogue import row
from jumping_ant.params.model import Params
from jumping_ant.sim.levels import LEVELS
from jumping_ant.sim.perturbations import NONE, Condition

EPISODES = 1  # of each seed at each level: the first of its held-out episodes


class Case(NamedTuple):
    """An episode to play."""

    condition: Condition
    seed: int  # of the policy
    start: int  # seed of the start state


def conditions() -> list[Condition]:
    """Return no perturbation, and every level of each."""
    levels = ((name, level) for name, row in LEVELS.items() for level in row.values)
    return [NONE, *(Condition(name, float(level)) for name, level in levels)]


def cases(params: Params, agent: str) -> Iterator[Case]:
    """Yield all episodes of an agent, seed by seed under each condition.

    Without perturbation they are more, as all that is kept is measured against them. Random actions
    play none: they hold no posture or rhythm that could be disturbed.
    """
    if not row(params.agent(agent)).is_perturbed:
        return
    for condition in conditions():
        count = num_episodes(params, condition)
        for seed in params.seeds:
            for start in params.evaluate.block(seed)[:count]:
                yield Case(condition, seed, start)


def num_episodes(params: Params, condition: Condition) -> int:
    """Return how many episodes of each seed are played under a condition."""
    return params.evaluate.baseline_episodes if condition == NONE else EPISODES
