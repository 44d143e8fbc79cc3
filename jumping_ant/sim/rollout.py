"""Episodes of a policy: many in parallel, each with its own seed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from jumping_ant.policies.policy import Policy
from jumping_ant.sim.rewards import PREFIX, active
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World

Array = NDArray[np.float64]


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
    airborne: NDArray[np.bool_]
    terminated: bool


def run(world: World, policy: Policy, seeds: Sequence[int], num_threads: int = 1) -> list[Episode]:
    """Run one episode for each seed, all in parallel, and return them in that order."""
    count, horizon, anatomy = len(seeds), world.env.max_episode_steps, world.anatomy
    envs = RobotVectorEnv(world, count, num_threads, AutoresetMode.DISABLED)
    observations, _ = envs.reset(seed=list(seeds))
    policy.start(seeds)
    start_qpos, start_qvel = envs.qpos.copy(), envs.qvel.copy()
    qpos = np.empty((horizon, count, anatomy.num_positions))
    qvel = np.empty((horizon, count, anatomy.num_velocities))
    torques, rewards = np.empty((horizon, count, anatomy.num_motors)), np.empty((horizon, count))
    terms = {name: np.empty((horizon, count)) for name in active(world.env.reward)}
    airborne = np.empty((horizon, count), dtype=np.bool_)
    lengths = np.zeros(count, dtype=np.int64)
    fell, alive = np.zeros(count, dtype=np.bool_), np.ones(count, dtype=np.bool_)
    for step in range(horizon):
        if step % policy.actions.hold == 0:
            choice = policy.act(observations)
        torques[step] = choice
        observations, rewards[step], terminated, truncated, infos = envs.step(torques[step])
        for name, values in terms.items():
            values[step] = infos[PREFIX + name]
        qpos[step], qvel[step], airborne[step] = envs.qpos, envs.qvel, envs.airborne
        lengths += alive
        fell |= alive & terminated
        alive &= ~(terminated | truncated)
        if not alive.any():
            break
    envs.close()
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
