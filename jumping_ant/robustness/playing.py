"""Held-out episodes of an agent's policies, under every perturbation and under none."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from jumping_ant.base import progress
from jumping_ant.experiment.models import Params
from jumping_ant.params.blocks import RobustnessParams
from jumping_ant.policies.policy import Policy
from jumping_ant.robustness.perturbations import NONE, Condition
from jumping_ant.robustness.perturbed import PerturbedVectorEnv
from jumping_ant.sim import rollout
from jumping_ant.sim.rollout import LARGEST_BATCH, SideBySide
from jumping_ant.sim.world import World


class Case(NamedTuple):
    """An episode to play."""

    condition: Condition
    seed: int  # of the policy
    start: int  # seed of the start state


def conditions(settings: RobustnessParams) -> list[Condition]:
    """Return no perturbation, and every level of each."""
    levels = settings.perturbations.model_dump()
    return [NONE, *(Condition(name, float(own)) for name in levels for own in levels[name])]


def cases(params: Params, agent: str) -> Iterator[Case]:
    """Yield all episodes of an agent, seed by seed under each condition.

    Without perturbation they are more, as all that is kept is measured against them. Random actions
    play none: they hold no posture or rhythm that could be disturbed.
    """
    if params.agent(agent).algorithm == "random":
        return
    for condition in conditions(params.robustness):
        count = num_episodes(params, condition)
        for seed in params.seeds:
            for start in params.evaluate.block(seed)[:count]:
                yield Case(condition, seed, start)


def num_episodes(params: Params, condition: Condition) -> int:
    """Return how many episodes of each seed are played under a condition."""
    levels, usual = params.robustness.episodes, params.evaluate.baseline_episodes
    return max(levels, usual) if condition == NONE else levels


def play(
    world: World, params: Params, agent: str, policies: Mapping[int, Policy], num_threads: int
) -> dict[Case, float]:
    """Play the episodes of an agent's seeds whose policies are given; return each one's return."""
    own = [case for case in cases(params, agent) if case.seed in policies]
    found = returns(world, params.robustness.episode_steps, agent, policies, own, num_threads)
    return dict(zip(own, found.tolist(), strict=True))


def returns(
    world: World,
    episode_steps: int,
    agent: str,
    policies: Mapping[int, Policy],
    played: Sequence[Case],
    num_threads: int = 1,
) -> NDArray[np.float64]:
    """Play episodes side by side, and return the return of each, (num_cases,).

    Args:
        world: The robot and the task.
        episode_steps: Length of the episodes [control steps].
        agent: The agent's name.
        policies: Each seed's policy.
        played: The episodes.
        num_threads: Threads that step the simulations; nothing depends on it.
    """
    short = World(world.xml, world.env.model_copy(update={"max_episode_steps": episode_steps}))
    parts = (
        _together(short, policies, played[first : first + LARGEST_BATCH], num_threads)
        for first in range(0, len(played), LARGEST_BATCH)
    )
    return np.concatenate([np.empty(0), *progress.shown(parts, len(played), agent, "episodes")])


def _together(
    world: World, policies: Mapping[int, Policy], played: Sequence[Case], num_threads: int
) -> NDArray[np.float64]:
    envs = PerturbedVectorEnv(world, [(case.condition, case.start) for case in played], num_threads)
    beside = SideBySide([(policies[case.seed], case.start) for case in played])
    total = np.zeros(len(played))
    with _simulations_may_fall_apart():
        for step in rollout.steps(envs, envs.begin(), beside.act, beside.hold):
            total += step.rewards
    return total


@contextmanager
def _simulations_may_fall_apart() -> Iterator[None]:
    """Let numbers overflow in silence, and MuJoCo warn of it in MUJOCO_LOG.TXT alone."""
    usual, quiet = mujoco.MjLogConfig.get(), mujoco.MjLogConfig.get()
    quiet.logto_console = False
    quiet.set()
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            yield
    finally:
        usual.set()
