"""What the rows work on: robot and task, agents as in the article, and its own environment."""

import tempfile
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.mujoco.ant_v5 import AntEnv
from numpy.typing import NDArray

from jumping_ant.params import params_file, presets
from jumping_ant.policies.actions import ActionSet
from jumping_ant.sim import robot
from jumping_ant.sim.world import World


def default_world() -> World:
    """Return robot and task of `params.yaml`, whether the pipeline has built it or not."""
    params = params_file.load()
    return World(robot.build(params.robot), params.env)


def article_agent(name: str) -> Any:
    """Return an agent's block with `presets/article` applied."""
    return presets.load("article").agent(name)


class ArticleAnt(AntEnv):
    """Gymnasium's `Ant-v5` on the edited robot, as the article's script creates it.

    Observation, action, reward, termination and physics are the project's.
    """

    def __init__(self, **options: Any) -> None:
        world = default_world()
        self._task = world.env
        with tempfile.NamedTemporaryFile("w", encoding="utf-8", suffix=".xml") as file:
            file.write(world.xml)
            file.flush()
            super().__init__(
                xml_file=file.name,
                frame_skip=self._task.frame_skip,
                healthy_z_range=(self._task.min_torso_height or -np.inf, np.inf),
                reset_noise_scale=self._task.reset_noise_scale,
                include_cfrc_ext_in_observation=False,
                **options,
            )

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float64], np.float64, bool, bool, dict[str, np.float64]]:
        """Hold the torques for a control step, and reward the height."""
        observation, _, terminated, truncated, info = super().step(action)
        term = self._task.reward.torso_height
        assert term is not None
        reward = term.weight * np.clip((self.data.qpos[2] - term.floor) / term.span, 0.0, 1.0)
        return observation, np.float64(reward), terminated, truncated, info


class Commanded(gym.Wrapper):
    """A step is a command, held for some control steps, as in the article's script for DQN."""

    def __init__(self, env: gym.Env, actions: ActionSet) -> None:
        super().__init__(env)
        assert actions.table is not None
        self._torques, self._hold = actions.table, actions.hold
        self.action_space = gym.spaces.Discrete(len(self._torques))

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Hold a command, or until the episode ends; return the sum of its rewards."""
        total = 0.0
        for _ in range(self._hold):
            observation, reward, terminated, truncated, info = self.env.step(self._torques[action])
            total += float(reward)
            if terminated or truncated:
                break
        return observation, total, terminated, truncated, info
