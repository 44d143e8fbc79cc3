"""The environment as the article's script creates it, on Gymnasium's own Ant."""

import tempfile
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.mujoco.ant_v5 import AntEnv
from numpy.typing import NDArray

from benchmarks.settings import default_world
from jumping_ant.policies.actions import ActionSet


class ArticleAnt(AntEnv):
    """Gymnasium's `Ant-v5` on the edited robot, rewarded for the height of its torso.

    Observation, action, reward and termination are the project's, as is the physics.

    Args:
        options: Further arguments of `AntEnv`, such as `render_mode`.
    """

    def __init__(self, **options: Any) -> None:
        world = default_world()
        self._task = world.env
        with tempfile.NamedTemporaryFile(
            "w", encoding="utf-8", suffix=".xml"
        ) as file:  # it needs a path
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
