"""Off-policy algorithms, on Stable-Baselines3.

Algorithms and networks are Stable-Baselines3's, some of them with leaner gradient steps (see the
catalogue).
"""

from collections.abc import Iterator
from typing import Any, cast

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.type_aliases import TrainFreq
from stable_baselines3.common.vec_env import VecEnv

from jumping_ant.agents.events import Event
from jumping_ant.agents.job import Job
from jumping_ant.agents.off_policy.algorithms import OffPolicyParams
from jumping_ant.agents.sb3 import loop, model


def train(job: Job[OffPolicyParams]) -> Iterator[Event]:
    """Train as `OffPolicyAlgorithm.learn` does; see `jumping_ant.agents.sb3.loop`."""
    envs = model.make_envs(job)
    yield from loop.run(job, make_model(envs, job.agent, job.seed), _learn_once)


def make_model(envs: VecEnv, agent: OffPolicyParams, seed: int) -> OffPolicyAlgorithm:
    """Return the untrained Stable-Baselines3 model of an agent."""
    more = {}
    if (deviation := getattr(agent, "action_noise", None)) is not None:
        zeros = np.zeros(cast(spaces.Box, envs.action_space).shape)
        more["action_noise"] = NormalActionNoise(zeros, zeros + deviation)
    made: OffPolicyAlgorithm = model.make_model(envs, agent, seed, **more)
    return made


def _learn_once(learner: Any, callback: BaseCallback, budget: int) -> None:
    """Collect one round of experience and learn from it: the body of SB3's `learn` loop."""
    rollout = learner.collect_rollouts(
        learner.env,
        callback=callback,
        train_freq=cast(TrainFreq, learner.train_freq),
        replay_buffer=cast(ReplayBuffer, learner.replay_buffer),
        action_noise=learner.action_noise,
        learning_starts=learner.learning_starts,
    )
    if learner.num_timesteps > learner.learning_starts:
        steps = learner.gradient_steps if learner.gradient_steps >= 0 else rollout.episode_timesteps
        learner.train(batch_size=learner.batch_size, gradient_steps=steps)
