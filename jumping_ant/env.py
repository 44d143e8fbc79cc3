"""`JumpingAnt-v0`: one jumping Ant as a Gymnasium environment.

Training, evaluation and populations use the batched `jumping_ant.vector.JumpingAntVectorEnv`; this
one is for people and tools. Tests hold the two bit-identical.

Observation, action and commands are described in `jumping_ant.task`.
"""

from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
from gymnasium.envs.mujoco.mujoco_rendering import MujocoRenderer
from numpy.typing import NDArray

from jumping_ant import params_file, robot
from jumping_ant.gl import select_backend
from jumping_ant.params import EnvParams
from jumping_ant.rewards import is_down, torso_height_reward
from jumping_ant.task import COMMANDS, action_space, observation_space, observe, start_state

ENV_ID = "JumpingAnt-v0"


class JumpingAnt(gym.Env[NDArray[Any], NDArray[Any]]):
    """A jumping Ant (its spaces are described in `jumping_ant.task`).

    `info` of each step holds `reward_height`, the one reward term, and `torso_height` [m].

    Args:
        xml: The robot as MJCF text; by default the robot of the project's `params.yaml`.
        params: The task; by default that of the project's `params.yaml`.
        render_mode: `rgb_array`, `human` or None.
        width: Width of the rendered picture [pixels].
        height: Height of the rendered picture [pixels].

    Raises:
        InputError: The XML is not a robot with the Ant's joints.
    """

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": 20}

    def __init__(
        self,
        xml: str | None = None,
        params: EnvParams | None = None,
        render_mode: str | None = None,
        width: int = 480,
        height: int = 480,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(
                f"render_mode: given {render_mode!r}, allowed: None, "
                f"{', '.join(map(repr, self.metadata['render_modes']))}"
            )
        self.params = params or params_file.load().env
        self.model = robot.load(xml or robot.build(params_file.load().robot))
        self.model.vis.global_.offwidth = max(self.model.vis.global_.offwidth, width)
        self.model.vis.global_.offheight = max(self.model.vis.global_.offheight, height)
        self.data = mujoco.MjData(self.model)
        self.metadata = self.metadata | {"render_fps": round(1 / self.dt)}
        self.render_mode = render_mode
        self.observation_space = observation_space()
        self.action_space = action_space(self.model)
        self._size = (width, height)
        self._renderer: MujocoRenderer | None = None
        self._num_steps = 0

    @property
    def dt(self) -> float:
        """Duration of a control step [s]."""
        return float(self.model.opt.timestep) * self.params.frame_skip

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Start an episode from a noisy standing pose."""
        super().reset(seed=seed)
        mujoco.mj_resetData(self.model, self.data)
        qpos, qvel = start_state(self.model, self.params.reset_noise_scale, self.np_random)
        self.data.qpos[:], self.data.qvel[:] = qpos, qvel
        mujoco.mj_forward(self.model, self.data)
        self._num_steps = 0
        if self.render_mode == "human":
            self.render()
        return self._observation(), {"torso_height": float(self.data.qpos[2])}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float64], float, bool, bool, dict[str, Any]]:
        """Hold eight torques for one control step."""
        self.data.ctrl[:] = action
        mujoco.mj_step(self.model, self.data, nstep=self.params.frame_skip)
        self._num_steps += 1
        qpos, qvel = self.data.qpos[None], self.data.qvel[None]
        reward = float(torso_height_reward(qpos[:, 2], self.params.reward)[0])
        terminated = bool(is_down(qpos, qvel, self.params.min_torso_height)[0])
        truncated = not terminated and self._num_steps >= self.params.max_episode_steps
        if self.render_mode == "human":
            self.render()
        info = {"reward_height": reward, "torso_height": float(qpos[0, 2])}
        return self._observation(), reward, terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the scene: an array of shape (height, width, 3), or the window."""
        if self.render_mode is None:
            return None
        if self._renderer is None:
            if self.render_mode == "rgb_array":
                select_backend()
            width, height = self._size
            self._renderer = MujocoRenderer(
                self.model, self.data, width=width, height=height, camera_name="track"
            )
        return self._renderer.render(self.render_mode)

    def close(self) -> None:
        """Close the window or the off-screen context."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _observation(self) -> NDArray[np.float64]:
        return observe(self.data.qpos[None], self.data.qvel[None])[0]


class DiscreteCommands(gym.ActionWrapper):
    """The five discrete commands of the source article, as actions 0 to 4.

    0: no torque; 1: +0.5 on all; 2: -0.5 on all; 3: +0.5 on actuators 0-3, the front legs, and -0.5
    on 4-7, the back legs; 4: the reverse. Command 3 pushes all feet down and 4 lifts them (see
    `jumping_ant.task`).
    """

    def __init__(self, env: gym.Env) -> None:
        super().__init__(env)
        self.action_space = gym.spaces.Discrete(len(COMMANDS))

    def action(self, action: int) -> NDArray[np.float32]:
        """Return the torques of a command, shape (8,)."""
        return COMMANDS[action]


gym.register(ENV_ID, entry_point="jumping_ant.env:JumpingAnt")
