"""The training loop of all algorithms of Stable-Baselines3.

It does what their `learn()` does, and yields events in between.
"""

from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, cast

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.logger import Logger

from jumping_ant.actions import ActionSet
from jumping_ant.agents.catalogue import row
from jumping_ant.agents.events import Checkpoint, Event, Finished, Progress, Snapshot
from jumping_ant.agents.job import Job
from jumping_ant.agents.sb3 import state
from jumping_ant.agents.sb3.model import policy_bytes
from jumping_ant.agents.sb3.settings import SB3Params

LearnOnce = Callable[[Any, BaseCallback, int], None]  # model, its callback, budget [decisions]


def run(job: Job[SB3Params], model: Any, learn_once: LearnOnce) -> Iterator[Event]:
    """Train as a model's `learn` does, with `learn_once` as the body of its loop."""
    agent = job.agent
    model.set_logger(Logger(folder=None, output_formats=[]))
    actions = ActionSet.of(agent.actions, job.world.env.commands)
    hold = actions.hold
    budget = -(-agent.total_steps // hold)  # in decisions, as SB3 counts
    _, callback = model._setup_learn(budget, CallbackList([]))
    episodes, counters = _EpisodeReturns(model), row(agent).counters
    if job.checkpoint is not None:
        episodes.count, episodes.returns = state.restore(model, counters, job.checkpoint)
    while model.num_timesteps < budget:
        before = model.num_timesteps
        learn_once(model, callback, budget)
        episodes.collect()
        is_evaluated = _crossed(before, model.num_timesteps, budget / job.evaluations)
        if is_evaluated or _crossed(before, model.num_timesteps, agent.log_interval):
            yield _progress(model, agent, episodes)
        if is_evaluated:
            yield Snapshot(model.num_timesteps * hold, policy_bytes(model, agent, actions))
        if job.is_checkpoint_due():
            content = state.capture(model, counters, [episodes.count, episodes.returns])
            yield Checkpoint(model.num_timesteps * hold, content)
    yield Finished(model.num_timesteps * hold, policy_bytes(model, agent, actions))


class _EpisodeReturns:
    """Returns of the training episodes, as SB3 records them."""

    def __init__(self, model: BaseAlgorithm) -> None:
        self.count = 0  # of all episodes so far
        self.returns: list[float] = []  # of the episodes since the last row
        self._model = model

    def collect(self) -> None:
        """Collect the episodes that ended since the last call."""
        buffer = cast(deque[dict[str, float]], self._model.ep_info_buffer)
        self.returns += [info["r"] for info in buffer]
        self.count += len(buffer)
        buffer.clear()

    def take(self) -> tuple[float, float]:
        """Return mean and standard deviation since the last call, NaN if no episode ended."""
        returns, self.returns = self.returns, []
        if not returns:
            return float("nan"), float("nan")
        return float(np.mean(returns)), float(np.std(returns))


def _progress(model: BaseAlgorithm, agent: SB3Params, episodes: _EpisodeReturns) -> Progress:
    return_mean, return_std = episodes.take()
    values = model.logger.name_to_value
    return Progress(
        env_steps=model.num_timesteps * agent.actions.hold,
        updates=model._n_updates,
        episodes=episodes.count,
        return_mean=return_mean,
        return_std=return_std,
        extra={key.partition("/")[2]: float(values.get(key, "nan")) for key in row(agent).logged},
    )


def _crossed(before: int, after: int, interval: float) -> bool:
    """Return whether a multiple of the interval lies in (before, after]."""
    return int(before / interval + 1e-9) < int(after / interval + 1e-9)
