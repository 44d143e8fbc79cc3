"""Models of Stable-Baselines3: their environments, their construction and their policy files."""

import copyreg
import io
import json
from pkgutil import resolve_name
from typing import Any, cast

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.type_aliases import TrainFrequencyUnit
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv

from jumping_ant.agents.catalogue import row
from jumping_ant.agents.job import Job
from jumping_ant.agents.sb3.settings import SB3Params
from jumping_ant.agents.sb3.vec_env import SB3VecEnv
from jumping_ant.base.archive import Archive, pack
from jumping_ant.base.seeding import derive, derive_all
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.policy import Interface, header_entries
from jumping_ant.sim.task import Task
from jumping_ant.sim.vector import RobotVectorEnv

# Policy files hold it pickled: by name in Python 3.11.2, and by value in later versions, as here.
copyreg.pickle(TrainFrequencyUnit, lambda unit: (TrainFrequencyUnit, (unit.value,)))

# State of the run rather than of the policy, and so excluded from policy files.
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
    """Multiplies velocities by a factor, so that network inputs have similar magnitudes."""

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


def make_model(envs: VecEnv, agent: SB3Params, seed: int) -> Any:
    """Return the untrained Stable-Baselines3 model of an agent.

    Settings that an algorithm adds to `SB3Params` are passed by name to the model's class, which
    refuses what it does not know, or to its policy (see `POLICY_SETTINGS`).
    """
    names = {"gamma"} | (type(agent).model_fields.keys() - SB3Params.model_fields.keys())
    settings = {name: getattr(agent, name) for name in names - {*agent.POLICY_SETTINGS}}
    first, last = agent.learning_rate, agent.final_learning_rate
    if "action_noise" in settings:
        zeros = np.zeros(cast(spaces.Box, envs.action_space).shape)
        settings["action_noise"] = NormalActionNoise(zeros, zeros + settings["action_noise"])
    model: BaseAlgorithm = resolve_name(row(agent).learner)(
        "MlpPolicy",
        envs,
        learning_rate=LinearSchedule(first, first if last is None else last, end_fraction=1.0),
        policy_kwargs={name: getattr(agent, name) for name in agent.POLICY_SETTINGS}
        | {
            "features_extractor_class": ScaledObservations,
            "features_extractor_kwargs": {
                "velocity_scale": agent.velocity_scale,
                "first_velocity": _task(envs).anatomy.num_observed_positions,
            },
        },
        seed=derive(seed, "learner", bits=32),
        device="cpu",
        **settings,
    )
    # SB3 seeds all generators alike; the networks' weights and noise keep that seed.
    np.random.seed(derive(seed, "replay", bits=32))  # for minibatches and exploration
    model.action_space.seed(derive(seed, "actions"))
    return model


def make_envs(job: Job[SB3Params]) -> SB3VecEnv:
    """Return the environments that an agent learns in; it treats truncation as a time limit."""
    agent, env = job.agent, job.world.env
    episode_steps = np.full(agent.num_envs, agent.episode_steps or np.inf)
    episode_steps[: round(agent.long_episodes * agent.num_envs)] = env.max_episode_steps
    envs = RobotVectorEnv(
        job.world,
        agent.num_envs,
        job.num_threads,
        actions=ActionSet.of(agent.actions, env.commands),
        episode_steps=episode_steps,
        tumbled_starts=agent.tumbled_starts,
    )
    starts = derive_all(job.seed, "starts", agent.num_envs)
    return SB3VecEnv(envs, starts, agent.sparse_rewards)


def policy_bytes(model: BaseAlgorithm, agent: SB3Params, actions: ActionSet) -> bytes:
    """Return a policy file that `SAC.load` or `DQN.load` can also read.

    Stable-Baselines3's archive contains dates and the state of the run; this one contains only the
    policy, and has the same bytes for the same run.
    """
    buffer = io.BytesIO()
    model.save(buffer, exclude=RUN_STATE)
    entries = dict(Archive(buffer.getvalue()))
    del entries["system_info.txt"]
    data = json.loads(entries["data"])
    for name, value in data.items():
        if isinstance(value, dict) and ":serialized:" in value:  # beside what shows addresses
            data[name] = {key: value[key] for key in (":type:", ":serialized:")}
    entries["data"] = json.dumps(data).encode()
    anatomy = _task(model.env).anatomy
    interface = Interface(actions, anatomy.num_observations, anatomy.num_motors)
    return pack(header_entries(row(agent).policy_kind, interface) | entries)


def _task(envs: VecEnv | None) -> Task:
    """Return the task of the environments that a model learns in."""
    task: Task = cast(VecEnv, envs).get_attr("task")[0]
    return task
