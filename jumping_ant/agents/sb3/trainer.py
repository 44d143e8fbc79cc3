"""The training loop of all algorithms of Stable-Baselines3: their `learn()`, with events between.

Algorithms and networks are Stable-Baselines3's, some with leaner gradient steps (see `off_policy`).
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm

from jumping_ant.agents.catalogue import row
from jumping_ant.agents.events import Checkpoint, Event, Finished, Progress, Snapshot
from jumping_ant.agents.job import Job
from jumping_ant.agents.sb3 import state
from jumping_ant.agents.sb3.model import make_envs, make_model, policy_bytes
from jumping_ant.agents.sb3.settings import SB3Params
from jumping_ant.policies.actions import ActionSet


def train(job: Job[SB3Params]) -> Iterator[Event]:
    """Train as a model's `learn` does."""
    agent = job.agent
    envs = make_envs(job)
    model = make_model(envs, agent, job.seed)
    model.set_logger(Logger(folder=None, output_formats=[]))
    actions = ActionSet.of(agent.actions, job.world.env.commands)
    budget = -(-agent.total_steps // actions.hold)  # in decisions, as SB3 counts
    _, callback = model._setup_learn(budget, CallbackList([]))
    num_episodes = 0  # up to the last row

    def env_steps() -> int:
        return model.num_timesteps * actions.hold - envs.envs.cut_steps

    if job.checkpoint is not None:
        num_episodes = state.restore(model, job.checkpoint)
    while model.num_timesteps < budget:
        before = model.num_timesteps
        _learn_once(model, callback, budget)
        is_evaluated = _crossed(before, model.num_timesteps, budget / job.evaluations)
        if is_evaluated or _crossed(before, model.num_timesteps, agent.log_interval):
            values = model.logger.name_to_value
            logged = {key.partition("/")[2]: values.get(key, "nan") for key in row(agent).logged}
            returns, envs.finished = envs.finished, []
            num_episodes += len(returns)
            yield Progress(
                env_steps=env_steps(),
                updates=model._n_updates,
                episodes=num_episodes,
                return_mean=float(np.mean(returns)) if returns else float("nan"),
                return_std=float(np.std(returns)) if returns else float("nan"),
                extra={name: float(value) for name, value in logged.items()},
            )
        if is_evaluated:
            yield Snapshot(env_steps(), policy_bytes(model, agent, actions))
        if job.is_checkpoint_due():
            yield Checkpoint(env_steps(), state.capture(model, num_episodes))
    yield Finished(env_steps(), policy_bytes(model, agent, actions))


def _learn_once(model: Any, callback: BaseCallback, budget: int) -> None:
    """Collect a round of experience and learn from it: the body of the loop of SB3's `learn`."""
    is_on_policy = isinstance(model, OnPolicyAlgorithm)
    if is_on_policy:
        model.collect_rollouts(model.env, callback, model.rollout_buffer, model.n_steps)
        model._update_current_progress_remaining(model.num_timesteps, budget)
        model.train()
        return
    model.collect_rollouts(
        model.env,
        callback,
        model.train_freq,
        model.replay_buffer,
        action_noise=model.action_noise,
        learning_starts=model.learning_starts,
    )
    if model.num_timesteps > model.learning_starts:
        model.train(batch_size=model.batch_size, gradient_steps=model.gradient_steps)


def _crossed(before: int, after: int, interval: float) -> bool:
    """Return whether a multiple of the interval lies in (before, after]."""
    return int(before / interval + 1e-9) < int(after / interval + 1e-9)
