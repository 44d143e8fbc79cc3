"""Play a policy in real time, in a window."""

import itertools
import time
from collections.abc import Iterator

import numpy as np

from jumping_ant.policies.policy import Policy
from jumping_ant.sim.env import RobotEnv


def play(
    env: RobotEnv, policy: Policy, first_seed: int, num_episodes: int | None
) -> Iterator[float]:
    """Play episodes, endlessly if `num_episodes` is None; yield rewards in real time.

    The seeds of the episodes count up from `first_seed`.
    """
    numbers = itertools.count() if num_episodes is None else range(num_episodes)
    for number in numbers:
        earned, due = 0.0, time.monotonic()
        for reward in _play_episode(env, policy, first_seed + number):
            yield reward
            earned += reward
            due = max(due + env.dt, time.monotonic() - env.dt)  # lost time is not made up for
            time.sleep(max(0.0, due - time.monotonic()))
        print(f"episode {number}: return {earned:,.0f}", flush=True)


def _play_episode(env: RobotEnv, policy: Policy, seed: int) -> Iterator[float]:
    observation, _ = env.reset(seed=seed)
    policy.start([seed])
    has_ended = False
    for number in itertools.count():
        if has_ended:
            return
        if number % policy.actions.hold == 0:
            torques = policy.act(observation[None])[0]
        observation, reward, terminated, truncated, _ = env.step(torques.astype(np.float32))
        has_ended = terminated or truncated
        yield reward
