"""On-policy algorithms, on Stable-Baselines3."""

from collections.abc import Iterator
from typing import Any

from stable_baselines3.common.callbacks import BaseCallback

from jumping_ant.agents.events import Event
from jumping_ant.agents.job import Job
from jumping_ant.agents.on_policy.algorithms import OnPolicyParams
from jumping_ant.agents.sb3 import loop, model


def train(job: Job[OnPolicyParams]) -> Iterator[Event]:
    """Train as `OnPolicyAlgorithm.learn` does; see `jumping_ant.agents.sb3.loop`."""
    envs = model.make_envs(job)
    yield from loop.run(job, model.make_model(envs, job.agent, job.seed), _learn_once)


def _learn_once(learner: Any, callback: BaseCallback, budget: int) -> None:
    """Collect a round of experience and learn from it: the body of SB3's `learn` loop."""
    learner.collect_rollouts(
        learner.env, callback, learner.rollout_buffer, n_rollout_steps=learner.n_steps
    )
    learner._update_current_progress_remaining(learner.num_timesteps, budget)
    learner.train()
