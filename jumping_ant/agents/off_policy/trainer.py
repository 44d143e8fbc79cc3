"""Off-policy algorithms, on Stable-Baselines3.

Algorithms and networks are Stable-Baselines3's, some of them with leaner gradient steps (see the
catalogue); the training loop does what its `learn()` does, and yields events in between.
"""

import inspect
import io
import json
from collections import deque
from collections.abc import Iterator
from typing import Any, cast

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.callbacks import CallbackList
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.type_aliases import TrainFreq
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv

from jumping_ant.actions import ActionSet
from jumping_ant.agents.catalogue import row
from jumping_ant.agents.events import Checkpoint, Event, Finished, Progress, Snapshot
from jumping_ant.agents.job import Job, resolve
from jumping_ant.agents.off_policy import state
from jumping_ant.agents.off_policy.algorithms import OffPolicyParams
from jumping_ant.agents.off_policy.vec_env import SB3VecEnv
from jumping_ant.base.archive import Archive, pack
from jumping_ant.base.seeding import derive, derive_all
from jumping_ant.params.blocks import EnvParams
from jumping_ant.policies.policy import Interface, header_entries
from jumping_ant.sim.task import Task
from jumping_ant.sim.vector import RobotVectorEnv

# State of the run rather than of the policy, and so excluded from policy files: times, and the last
# observations and episodes.
RUN_STATE = (
    "start_time",
    "ep_info_buffer",
    "ep_success_buffer",
    "_last_obs",
    "_last_original_obs",
    "_last_episode_starts",
    "_logger",
)


class ScaledObservations(BaseFeaturesExtractor):
    """Multiplies velocities by a factor, so that network inputs have similar magnitudes.

    Args:
        observation_space: The space of one observation.
        velocity_scale: The factor.
        first_velocity: Index of the first velocity; positions come before it.
    """

    def __init__(
        self, observation_space: spaces.Box, velocity_scale: float, first_velocity: int
    ) -> None:
        super().__init__(observation_space, features_dim=observation_space.shape[0])
        factors = torch.ones(observation_space.shape)
        factors[first_velocity:] = velocity_scale
        self.factors: torch.Tensor
        self.register_buffer("factors", factors)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return scaled observations, shape (n, num_observations)."""
        return observations * self.factors


def make_model(envs: VecEnv, agent: OffPolicyParams, seed: int) -> OffPolicyAlgorithm:
    """Return the untrained Stable-Baselines3 model of an agent.

    Args:
        envs: Environments to learn in.
        agent: The agent's block; settings that are parameters of the model's class are passed by
            name.
        seed: Seed that determines the run.
    """
    learner = resolve(row(agent).learner)
    known = inspect.signature(learner).parameters
    settings: dict[str, Any] = {
        name: getattr(agent, name) for name in type(agent).model_fields if name in known
    }
    settings["learning_rate"] = LinearSchedule(
        agent.learning_rate, agent.final_learning_rate, end_fraction=1.0
    )
    if "action_noise" in settings:
        num_motors = cast(spaces.Box, envs.action_space).shape[0]
        deviations = np.full(num_motors, settings["action_noise"])
        settings["action_noise"] = NormalActionNoise(np.zeros(num_motors), deviations)
    policy_kwargs = {
        "net_arch": agent.net_arch,
        "features_extractor_class": ScaledObservations,
        "features_extractor_kwargs": {
            "velocity_scale": agent.velocity_scale,
            "first_velocity": _task(envs).anatomy.num_observed_positions,
        },
    }
    model: OffPolicyAlgorithm = learner(
        "MlpPolicy",
        envs,
        policy_kwargs=policy_kwargs,
        seed=derive(seed, "learner", bits=32),
        device="cpu",
        **settings,
    )
    # SB3 seeds all generators alike; the networks' weights and noise keep that seed.
    np.random.seed(derive(seed, "replay", bits=32))  # for replay sampling and exploration
    model.action_space.seed(derive(seed, "actions"))
    return model


def make_envs(
    xml: str, env: EnvParams, agent: OffPolicyParams, seed: int, num_threads: int = 1
) -> VecEnv:
    """Return the environments that an agent learns in.

    Episodes are truncated as the agent's block specifies; learners treat this as a time limit.

    Args:
        xml: The robot as MJCF text.
        env: The task.
        agent: The agent's block.
        seed: Seed of the start states.
        num_threads: Threads that step the simulations; results do not depend on it.
    """
    episode_steps = np.full(agent.num_envs, agent.episode_steps or np.inf)
    episode_steps[: round(agent.long_episodes * agent.num_envs)] = env.max_episode_steps
    envs = RobotVectorEnv(
        xml,
        env,
        agent.num_envs,
        num_threads,
        actions=ActionSet.of(agent.actions, env.commands),
        episode_steps=episode_steps,
        tumbled_starts=agent.tumbled_starts,
    )
    return SB3VecEnv(envs, derive_all(seed, "starts", agent.num_envs))


def train(job: Job[OffPolicyParams]) -> Iterator[Event]:
    """Train as `OffPolicyAlgorithm.learn` does.

    Yields:
        Progress every `log_interval` transitions (with what the learner logs), snapshots of the
        policy, checkpoints when due, and finally the policy.
    """
    agent = job.agent
    envs = make_envs(job.xml, job.env, agent, job.seed, job.num_threads)
    model = make_model(envs, agent, job.seed)
    model.set_logger(Logger(folder=None, output_formats=[]))
    actions = ActionSet.of(agent.actions, job.env.commands)
    hold = actions.hold
    budget = -(-agent.total_steps // hold)  # in decisions, as SB3 counts
    _, callback = model._setup_learn(budget, CallbackList([]))
    episodes, counters = _EpisodeReturns(model), row(agent).counters
    if job.checkpoint is not None:
        episodes.count, episodes.returns = state.restore(model, counters, job.checkpoint)
    while model.num_timesteps < budget:
        before = model.num_timesteps
        _learn_once(model, callback)
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


def policy_bytes(model: OffPolicyAlgorithm, agent: OffPolicyParams, actions: ActionSet) -> bytes:
    """Return a policy file that `SAC.load` or `DQN.load` can also read.

    Stable-Baselines3's archive contains dates and the state of the run; this one contains only the
    policy, and has the same bytes for the same run.

    Args:
        model: The model.
        agent: The agent's block.
        actions: Actions that it chooses from.
    """
    buffer = io.BytesIO()
    model.save(buffer, exclude=RUN_STATE)
    entries = dict(Archive(buffer.getvalue()))
    del entries["system_info.txt"]
    entries["data"] = json.dumps(_without_addresses(json.loads(entries["data"]))).encode()
    anatomy = _task(model.env).anatomy
    interface = Interface(actions, anatomy.num_observations, anatomy.num_motors)
    return pack(header_entries(agent.algorithm, interface) | entries)


def _task(envs: VecEnv | None) -> Task:
    """Return the task of the environments that a model learns in."""
    task: Task = cast(VecEnv, envs).get_attr("task")[0]
    return task


def _without_addresses(data: dict[str, Any]) -> dict[str, Any]:
    """Drop SB3's descriptions of pickled entries, which show memory addresses."""
    return {
        key: {":type:": value[":type:"], ":serialized:": value[":serialized:"]}
        if isinstance(value, dict) and ":serialized:" in value
        else value
        for key, value in data.items()
    }


def _learn_once(model: OffPolicyAlgorithm, callback: Any) -> None:
    """Collect one round of experience and learn from it: the body of SB3's `learn` loop."""
    rollout = model.collect_rollouts(
        cast(VecEnv, model.env),
        callback=callback,
        train_freq=cast(TrainFreq, model.train_freq),
        replay_buffer=cast(ReplayBuffer, model.replay_buffer),
        action_noise=model.action_noise,
        learning_starts=model.learning_starts,
    )
    if model.num_timesteps > model.learning_starts:
        steps = model.gradient_steps if model.gradient_steps >= 0 else rollout.episode_timesteps
        model.train(batch_size=model.batch_size, gradient_steps=steps)


class _EpisodeReturns:
    """Returns of the training episodes, as SB3 records them.

    Attributes:
        count: Number of episodes so far.
        returns: Returns of the episodes since the last row.
    """

    def __init__(self, model: OffPolicyAlgorithm) -> None:
        self.count = 0
        self.returns: list[float] = []
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


def _progress(
    model: OffPolicyAlgorithm, agent: OffPolicyParams, episodes: _EpisodeReturns
) -> Progress:
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
