"""DQN and SAC, on Stable-Baselines3.

DQN (Mnih et al. 2015, "Human-level control through deep reinforcement learning") acts by five
discrete commands, SAC (Haarnoja et al. 2018, "Soft Actor-Critic Algorithms and Applications") by
continuous torques. Algorithms and networks are Stable-Baselines3's, with leaner gradient steps; the
loop around them does what its `learn()` does, and yields in between.
"""

import io
import json
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, cast

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.callbacks import CallbackList
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.type_aliases import TrainFreq
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv

from jumping_ant.actions import ActionSet
from jumping_ant.agents.events import Checkpoint, Event, Finished, Progress, Snapshot
from jumping_ant.agents.off_policy import state
from jumping_ant.agents.off_policy.learners import LeanDQN, LeanSAC
from jumping_ant.agents.off_policy.vec_env import SB3VecEnv
from jumping_ant.base.archive import pack, unpack
from jumping_ant.base.seeding import derive, derive_all
from jumping_ant.params.models import DQNParams, EnvParams, SACParams
from jumping_ant.policies import network_entries, velocity_factors
from jumping_ant.sim.vector import JumpingAntVectorEnv

# What the learning curve keeps of SB3's log, by algorithm.
LOGGED = {
    "dqn": ("train/loss", "rollout/exploration_rate"),
    "sac": ("train/actor_loss", "train/critic_loss", "train/ent_coef"),
}
# State of the run rather than of the policy, and so not in a policy file: times, and the last
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
    """Multiplies velocities by a factor, so that the networks see numbers of like size.

    Args:
        observation_space: The space of one observation, 27 numbers.
        velocity_scale: The factor.
    """

    def __init__(self, observation_space: spaces.Box, velocity_scale: float) -> None:
        super().__init__(observation_space, features_dim=observation_space.shape[0])
        self.factors: torch.Tensor
        self.register_buffer("factors", torch.from_numpy(velocity_factors(velocity_scale)))

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return scaled observations, shape (n, 27)."""
        return observations * self.factors


COMMON_SETTINGS = (
    "buffer_size",
    "learning_starts",
    "batch_size",
    "tau",
    "gamma",
    "n_steps",
    "train_freq",
    "gradient_steps",
)
DQN_SETTINGS = (
    "target_update_interval",
    "exploration_fraction",
    "exploration_initial_eps",
    "exploration_final_eps",
    "max_grad_norm",
)
SAC_SETTINGS = ("ent_coef",)


def make_model(envs: VecEnv, agent: DQNParams | SACParams, seed: int) -> LeanDQN | LeanSAC:
    """Return the untrained Stable-Baselines3 model of an agent.

    Args:
        envs: Where it will learn.
        agent: The agent's block.
        seed: Determines the run.
    """
    is_sac = isinstance(agent, SACParams)
    names = COMMON_SETTINGS + (SAC_SETTINGS if is_sac else DQN_SETTINGS)
    settings: dict[str, Any] = {name: getattr(agent, name) for name in names}
    settings["learning_rate"] = LinearSchedule(
        agent.learning_rate, agent.final_learning_rate, end_fraction=1.0
    )
    policy_kwargs = {
        "net_arch": agent.net_arch,
        "features_extractor_class": ScaledObservations,
        "features_extractor_kwargs": {"velocity_scale": agent.velocity_scale},
    }
    algorithm: Any = LeanSAC if is_sac else LeanDQN
    model: LeanDQN | LeanSAC = algorithm(
        "MlpPolicy",
        envs,
        policy_kwargs=policy_kwargs,
        seed=derive(seed, "learner", bits=32),
        device="cpu",
        **settings,
    )
    # SB3 seeds everything alike; the networks' weights and noise keep that seed.
    np.random.seed(derive(seed, "replay", bits=32))  # draws transitions, and explores
    model.action_space.seed(derive(seed, "actions"))
    return model


def make_envs(
    xml: str, env: EnvParams, agent: DQNParams | SACParams, seed: int, num_threads: int = 1
) -> VecEnv:
    """Return the environments an agent learns in: torques for SAC, commands for DQN.

    Their episodes are cut as the agent's block says, which learners treat as the time limit it is.

    Args:
        xml: The robot as MJCF text.
        env: The task.
        agent: The agent's block.
        seed: Of the start states.
        num_threads: Threads that step the simulations; results do not depend on it.
    """
    episode_steps = np.full(agent.num_envs, agent.episode_steps or np.inf)
    episode_steps[: round(agent.long_episodes * agent.num_envs)] = env.max_episode_steps
    envs = JumpingAntVectorEnv(
        xml,
        env,
        agent.num_envs,
        num_threads,
        actions=ActionSet.of(agent.actions),
        episode_steps=episode_steps,
        tumbled_starts=agent.tumbled_starts,
    )
    return SB3VecEnv(envs, derive_all(seed, "starts", agent.num_envs))


def train(
    xml: str,
    env: EnvParams,
    agent: DQNParams | SACParams,
    seed: int,
    evaluations: int,
    num_threads: int = 1,
    checkpoint: bytes | None = None,
    is_checkpoint_due: Callable[[], bool] = lambda: False,
) -> Iterator[Event]:
    """Train DQN or SAC, as `OffPolicyAlgorithm.learn` does.

    Args:
        xml: The robot as MJCF text.
        env: The task.
        agent: The agent's block.
        seed: Determines the run.
        evaluations: Number of snapshots, spread evenly over the budget.
        num_threads: Threads that step the simulations; results do not depend on it.
        checkpoint: Where to resume from, as an earlier call yielded it.
        is_checkpoint_due: Asked after every round.

    Yields:
        Progress every `log_interval` transitions (with losses, and the exploration rate or the
        entropy coefficient), snapshots of the policy, checkpoints when due, and at last the policy.
    """
    model = make_model(make_envs(xml, env, agent, seed, num_threads), agent, seed)
    model.set_logger(Logger(folder=None, output_formats=[]))
    hold = agent.actions.hold
    budget = -(-agent.total_steps // hold)  # decisions, as SB3 counts
    _, callback = model._setup_learn(budget, CallbackList([]))
    episodes = _EpisodeReturns(model)
    if checkpoint is not None:
        episodes.count, episodes.returns = state.restore(model, checkpoint)
    while model.num_timesteps < budget:
        before = model.num_timesteps
        _learn_once(model, callback)
        episodes.collect()
        is_evaluated = _crossed(before, model.num_timesteps, budget / evaluations)
        if is_evaluated or _crossed(before, model.num_timesteps, agent.log_interval):
            yield _progress(model, agent, episodes)
        if is_evaluated:
            yield Snapshot(model.num_timesteps * hold, policy_file(model, agent))
        if is_checkpoint_due():
            content = state.capture(model, [episodes.count, episodes.returns])
            yield Checkpoint(model.num_timesteps * hold, content)
    yield Finished(model.num_timesteps * hold, policy_file(model, agent))


def policy_file(model: OffPolicyAlgorithm, agent: DQNParams | SACParams) -> bytes:
    """Return a policy file that `SAC.load` or `DQN.load` reads as well.

    Stable-Baselines3 dates its archive and keeps the state of the run in it; this one holds the
    policy alone, and is the same bytes for the same run.
    """
    buffer = io.BytesIO()
    model.save(buffer, exclude=RUN_STATE)
    entries = unpack(buffer.getvalue())
    del entries["system_info.txt"]
    entries["data"] = json.dumps(_without_addresses(json.loads(entries["data"]))).encode()
    own = network_entries(agent.algorithm, ActionSet.of(agent.actions), agent.velocity_scale)
    return pack(own | entries)


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
    """Returns of the training episodes, as SB3 notes them.

    Attributes:
        count: Of the episodes so far.
        returns: Of those since the last row.
    """

    def __init__(self, model: OffPolicyAlgorithm) -> None:
        self.count = 0
        self.returns: list[float] = []
        self._model = model

    def collect(self) -> None:
        """Take over the episodes that ended since the last call."""
        buffer = cast(deque[dict[str, float]], self._model.ep_info_buffer)
        self.returns += [info["r"] for info in buffer]
        self.count += len(buffer)
        buffer.clear()

    def take(self) -> tuple[float, float]:
        """Return mean and deviation since the last call, NaN where no episode ended."""
        returns, self.returns = self.returns, []
        if not returns:
            return float("nan"), float("nan")
        return float(np.mean(returns)), float(np.std(returns))


def _progress(
    model: OffPolicyAlgorithm, agent: DQNParams | SACParams, episodes: _EpisodeReturns
) -> Progress:
    return_mean, return_std = episodes.take()
    values = model.logger.name_to_value
    return Progress(
        env_steps=model.num_timesteps * agent.actions.hold,
        updates=model._n_updates,
        episodes=episodes.count,
        return_mean=return_mean,
        return_std=return_std,
        extra={
            key.partition("/")[2]: float(values.get(key, "nan")) for key in LOGGED[agent.algorithm]
        },
    )


def _crossed(before: int, after: int, interval: float) -> bool:
    """Tell whether a multiple of the interval lies in (before, after]."""
    return int(before / interval + 1e-9) < int(after / interval + 1e-9)
