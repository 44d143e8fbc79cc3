"""Episodes of policies: many in parallel, each with its own seed."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jumping_ant.base.errors import InputError
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.blind import UniformPolicy
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import perturbations
from jumping_ant.sim.perturbations import NONE, Condition
from jumping_ant.sim.rewards import PREFIX, active
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LARGEST_BATCH = 256  # episodes; a step of more is no faster for each
LARGEST_RECORD = 2**25  # numbers kept of the episodes of a batch: 256 MiB, at its end twice


class Play(NamedTuple):
    """An episode to play: by whom, from where, and what disturbs it."""

    policy: Policy
    start: int  # seed of the start state
    condition: Condition = NONE


class Transition(NamedTuple):
    """A step of n environments, some of whose episodes may have ended before."""

    observations: Array  # before the step, shape (n, num_observations)
    actions: NDArray[Any]  # shape (n, num_motors) or (n,)
    next_observations: Array
    rewards: Array  # zero where no episode ran, shape (n,)
    infos: dict[str, Any]  # as the environments return them
    alive: Mask  # whether an episode ran before the step, shape (n,)
    terminated: Mask  # whether it terminated in the step, shape (n,)


def steps(
    envs: RobotVectorEnv, observations: Array, act: Callable[[Array], NDArray[Any]], hold: int = 1
) -> Iterator[Transition]:
    """Step environments without autoreset, just reset, until the episodes of all have ended.

    `act` chooses actions every `hold` steps. At each yield, the environments are in the state after
    the step.
    """
    alive, number = np.ones(envs.num_envs, dtype=np.bool_), 0
    while alive.any():
        if number % hold == 0:
            actions = act(observations)
        after, rewards, terminated, truncated, infos = envs.step(actions)
        ends = alive & terminated
        yield Transition(observations, actions, after, rewards * alive, infos, alive, ends)
        observations, alive = after, alive & ~(terminated | truncated)
        number += 1


@dataclass(frozen=True)
class Episode:
    """One episode, a row per control step (T rows)."""

    start_qpos: Array  # (num_positions,)
    start_qvel: Array  # (num_velocities,)
    qpos: Array  # after each step, (T, num_positions)
    qvel: Array  # after each step, (T, num_velocities)
    torques: Array  # over peak torques, (T, num_motors)
    rewards: Array  # (T,)
    terms: dict[str, Array]  # contribution of each term to the reward, (T,) each
    airborne: Mask  # whether the robot touches nothing, (T,)
    terminated: bool  # whether the episode ended early

    def total(self) -> float:
        """Return the sum of the rewards."""
        return float(self.rewards.sum())


def run(world: World, policy: Policy, seeds: Sequence[int], num_threads: int = 1) -> list[Episode]:
    """Run one episode of a policy for each seed, and return them in that order."""
    return list(play(world, [Play(policy, seed) for seed in seeds], num_threads))


def play(world: World, plays: Sequence[Play], num_threads: int = 1) -> Iterator[Episode]:
    """Run episodes and yield them in their order.

    They run side by side, as many as `LARGEST_RECORD` allows; no episode depends on those beside
    it. All policies hold their choices equally long.
    """
    numbers = world.anatomy.num_positions + world.anatomy.num_velocities + world.anatomy.num_motors
    numbers_each = world.env.max_episode_steps * (numbers + 2 + len(active(world.env.reward)))
    size = min(LARGEST_BATCH, max(1, LARGEST_RECORD // numbers_each))
    for first in range(0, len(plays), size):
        yield from _together(world, plays[first : first + size], num_threads)


def returns(world: World, plays: Sequence[Play], num_threads: int = 1) -> Array:
    """Return the sum of the rewards of each episode (see `play`), shape (num_episodes,)."""
    return np.array([episode.total() for episode in play(world, plays, num_threads)])


def require_stability(world: World) -> None:
    """Raise an InputError if a robot falls apart at once: it could neither learn nor be shown."""
    few = {"max_episode_steps": 5, "frame_skip": min(world.env.frame_skip, 5)}
    start = World(world.xml, world.env.model_copy(update=few))
    policy = UniformPolicy(0, ActionSet(), world.anatomy.num_motors)
    with perturbations.silence():
        episodes = run(start, policy, range(8))
    if not all(np.isfinite(episode.qvel).all() for episode in episodes):
        raise InputError(
            "robot: given one that falls apart in its first moments, allowed: less damping, gear, "
            "contact_margin or env.reset_noise_scale, or a shorter time step "
            "(robot.edits: {option: {'*': {timestep: 0.002}}})"
        )


def _start(plays: Sequence[Play], num_motors: int) -> tuple[Callable[[Array], Array], int]:
    """Start policies, each in its episodes; return what chooses all torques, and their hold."""
    rows = defaultdict(list)
    for row, play in enumerate(plays):
        rows[id(play.policy)].append(row)
    parts = [(plays[places[0]].policy, np.array(places)) for places in rows.values()]
    for policy, places in parts:
        policy.start([plays[row].start for row in places])
    (hold,) = {policy.actions.hold for policy, _ in parts}

    def act(observations: Array) -> Array:
        torques = np.empty((len(observations), num_motors))
        for policy, places in parts:
            torques[places] = policy.act(observations[places])
        return torques

    return act, hold


def _together(world: World, plays: Sequence[Play], num_threads: int) -> list[Episode]:
    starts = [play.start for play in plays]
    conditions = [play.condition for play in plays]
    envs = perturbations.environments(world, conditions, starts, num_threads)
    observations, _ = envs.reset(seed=starts)
    act, hold = _start(plays, world.anatomy.num_motors)
    start_qpos, start_qvel = envs.qpos.copy(), envs.qvel.copy()
    names = list(active(world.env.reward))
    lengths, fell = np.zeros(len(plays), np.int64), np.zeros(len(plays), np.bool_)
    moments: list[tuple[NDArray[Any], ...]] = []
    is_usual = all(condition == NONE for condition in conditions)
    with nullcontext() if is_usual else perturbations.silence():
        for step in steps(envs, observations, act, hold):
            state = (envs.qpos.copy(), envs.qvel.copy(), envs.airborne)
            earned = [step.rewards, *(step.infos[PREFIX + name] for name in names)]
            moments.append((*state, step.actions, *earned))
            lengths += step.alive
            fell |= step.terminated
    qpos, qvel, airborne, torques, rewards, *terms = map(np.array, zip(*moments, strict=True))
    return [
        Episode(
            start_qpos[i],
            start_qvel[i],
            qpos[:length, i],
            qvel[:length, i],
            torques[:length, i],
            rewards[:length, i],
            {name: values[:length, i] for name, values in zip(names, terms, strict=True)},
            airborne[:length, i],
            bool(fell[i]),
        )
        for i, length in enumerate(lengths)
    ]
