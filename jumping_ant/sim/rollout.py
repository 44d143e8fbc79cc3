"""Episodes of a policy: many at once, each from a seed of its own."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from jumping_ant.params.models import EnvParams
from jumping_ant.policies import Policy
from jumping_ant.sim.vector import JumpingAntVectorEnv

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Episode:
    """One episode, a row per control step (T rows).

    Attributes:
        start_qpos: Positions at the start, shape (15,).
        start_qvel: Velocities at the start, shape (14,).
        qpos: Positions after each step, shape (T, 15).
        qvel: Velocities after each step, shape (T, 14).
        torques: The actions, torque over peak torque, shape (T, 8).
        rewards: Shape (T,).
        airborne: Whether the robot touches nothing, shape (T,).
        terminated: Whether the episode ended early.
    """

    start_qpos: Array
    start_qvel: Array
    qpos: Array
    qvel: Array
    torques: Array
    rewards: Array
    airborne: NDArray[np.bool_]
    terminated: bool


def run(
    xml: str, env: EnvParams, policy: Policy, seeds: Sequence[int], num_threads: int = 1
) -> list[Episode]:
    """Run one episode for each seed, all side by side.

    Args:
        xml: The robot as MJCF text.
        env: The task.
        policy: What acts.
        seeds: Seed of each episode.
        num_threads: Threads that step the simulations; results do not depend on it.

    Returns:
        The episodes, in the order of the seeds.
    """
    count, horizon = len(seeds), env.max_episode_steps
    envs = JumpingAntVectorEnv(xml, env, count, num_threads, AutoresetMode.DISABLED)
    observations, _ = envs.reset(seed=list(seeds))
    policy.start(seeds)
    start_qpos, start_qvel = envs.qpos.copy(), envs.qvel.copy()
    qpos, qvel = np.empty((horizon, count, 15)), np.empty((horizon, count, 14))
    torques, rewards = np.empty((horizon, count, 8)), np.empty((horizon, count))
    airborne = np.empty((horizon, count), dtype=np.bool_)
    lengths = np.zeros(count, dtype=np.int64)
    fell, alive = np.zeros(count, dtype=np.bool_), np.ones(count, dtype=np.bool_)
    for step in range(horizon):
        if step % policy.actions.hold == 0:
            choice = policy.act(observations)
        torques[step] = choice
        observations, rewards[step], terminated, truncated, _ = envs.step(torques[step])
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
            airborne[:length, i],
            bool(fell[i]),
        )
        for i, length in enumerate(lengths)
    ]
