"""Episodes of policies: many in parallel, each with its own seed."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jumping_ant.policies.policy import Policy
from jumping_ant.sim import perturbations
from jumping_ant.sim.perturbations import NONE, Condition
from jumping_ant.sim.rewards import PREFIX, active
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LARGEST_BATCH = 256  # episodes; a step of more is no faster for each
LARGEST_RECORD = 2**25  # numbers that are kept of the episodes of a batch: 256 MiB


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
    """Step environments without autoreset until the episodes of all have ended.

    They were just reset, which returned the observations. `act` chooses actions for observations
    every `hold` steps. At each yield, the environments are in the state after the step.
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
    """One episode, a row per control step (T rows).

    Attributes:
        start_qpos: Positions at the start, shape (num_positions,).
        start_qvel: Velocities at the start, shape (num_velocities,).
        qpos: Positions after each step, shape (T, num_positions).
        qvel: Velocities after each step, shape (T, num_velocities).
        torques: The actions, torque over peak torque, shape (T, num_motors).
        rewards: Shape (T,).
        terms: Contribution of each term to the reward, shape (T,) each.
        airborne: Whether the robot touches nothing, shape (T,).
        terminated: Whether the episode ended early.
    """

    start_qpos: Array
    start_qvel: Array
    qpos: Array
    qvel: Array
    torques: Array
    rewards: Array
    terms: dict[str, Array]
    airborne: Mask
    terminated: bool

    def total(self) -> float:
        """Return the sum of the rewards."""
        return float(self.rewards.sum())


def run(world: World, policy: Policy, seeds: Sequence[int], num_threads: int = 1) -> list[Episode]:
    """Run one episode of a policy for each seed, and return them in that order."""
    return list(play(world, [Play(policy, seed) for seed in seeds], num_threads))


def play(world: World, plays: Sequence[Play], num_threads: int = 1) -> Iterator[Episode]:
    """Run episodes and yield them in their order.

    They run side by side, as many as `LARGEST_RECORD` allows; no episode depends on those beside
    it. The policies hold their choices for equally long. An episode that is kept keeps those that
    ran beside it.
    """
    numbers = world.anatomy.num_positions + world.anatomy.num_velocities + world.anatomy.num_motors
    numbers_each = world.env.max_episode_steps * (numbers + 2 + len(active(world.env.reward)))
    size = min(LARGEST_BATCH, max(1, LARGEST_RECORD // numbers_each))
    for first in range(0, len(plays), size):
        yield from _together(world, plays[first : first + size], num_threads)


def returns(world: World, plays: Sequence[Play], num_threads: int = 1) -> Array:
    """Return the sum of the rewards of each episode (see `play`), shape (num_episodes,)."""
    return np.array([episode.total() for episode in play(world, plays, num_threads)])


class SideBySide:
    """Policies of the episodes of a batch, each of which acts in its own."""

    def __init__(self, plays: Sequence[Play]) -> None:
        rows = defaultdict(list)
        for row, play in enumerate(plays):
            rows[id(play.policy)].append(row)
        self._parts = [(plays[own[0]].policy, np.array(own)) for own in rows.values()]
        for policy, own in self._parts:
            policy.start([plays[row].start for row in own])
        holds = {policy.actions.hold for policy, _ in self._parts}
        if len(holds) > 1:
            raise ValueError(f"given choices held for {sorted(holds)} control steps, allowed: one")
        (self.hold,) = holds

    def act(self, observations: Array) -> Array:
        """Return torques, (n, num_motors), for the observations of all episodes."""
        parts = [policy.act(observations[rows]) for policy, rows in self._parts]
        torques = np.empty((len(observations), parts[0].shape[1]))
        for (_, rows), own in zip(self._parts, parts, strict=True):
            torques[rows] = own
        return torques


def _together(world: World, plays: Sequence[Play], num_threads: int) -> list[Episode]:
    count, horizon, anatomy = len(plays), world.env.max_episode_steps, world.anatomy
    starts = [play.start for play in plays]
    conditions = [play.condition for play in plays]
    envs = perturbations.environments(world, conditions, starts, num_threads)
    observations, _ = envs.reset(seed=starts)
    policies = SideBySide(plays)
    start_qpos, start_qvel = envs.qpos.copy(), envs.qvel.copy()
    qpos = np.empty((horizon, count, anatomy.num_positions))
    qvel = np.empty((horizon, count, anatomy.num_velocities))
    torques, rewards = np.empty((horizon, count, anatomy.num_motors)), np.empty((horizon, count))
    terms = {name: np.empty((horizon, count)) for name in active(world.env.reward)}
    airborne = np.empty((horizon, count), dtype=np.bool_)
    lengths = np.zeros(count, dtype=np.int64)
    fell = np.zeros(count, dtype=np.bool_)
    is_usual = all(condition == NONE for condition in conditions)
    with nullcontext() if is_usual else perturbations.silence():
        for number, step in enumerate(steps(envs, observations, policies.act, policies.hold)):
            torques[number], rewards[number] = step.actions, step.rewards
            for name, values in terms.items():
                values[number] = step.infos[PREFIX + name]
            qpos[number], qvel[number], airborne[number] = envs.qpos, envs.qvel, envs.airborne
            lengths += step.alive
            fell |= step.terminated
    return [
        Episode(
            start_qpos[i],
            start_qvel[i],
            qpos[:length, i],
            qvel[:length, i],
            torques[:length, i],
            rewards[:length, i],
            {name: values[:length, i] for name, values in terms.items()},
            airborne[:length, i],
            bool(fell[i]),
        )
        for i, length in enumerate(lengths)
    ]
