"""`JumpingAnt-v0`: the article's jumping Ant as a Gymnasium environment.

`gym.make("JumpingAnt-v0")` always is the article's robot and task, whatever `params.yaml` says, and
`gym.make_vec("JumpingAnt-v0", num_envs=n)` a batch of them on MuJoCo's native threads.

Training, evaluation and populations use the batched `jumping_ant.sim.vector.JumpingAntVectorEnv`;
this one is for people and tools. Tests hold the two bit-identical.

Observation, action and commands are described in `jumping_ant.sim.task`.
"""

from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
from gymnasium.envs.mujoco.mujoco_rendering import MujocoRenderer
from numpy.typing import NDArray

from jumping_ant.actions import ActionSet
from jumping_ant.params import article
from jumping_ant.params.models import EnvParams
from jumping_ant.sim import robot
from jumping_ant.sim.gl import select_backend
from jumping_ant.sim.rewards import is_down, torso_height_reward
from jumping_ant.sim.task import action_space, observation_space, observe, start_state
from jumping_ant.sim.vector import JumpingAntVectorEnv

ENV_ID = "JumpingAnt-v0"


class JumpingAnt(gym.Env[NDArray[Any], NDArray[Any]]):
    """A jumping Ant (its spaces are described in `jumping_ant.sim.task`).

    `info` of each step holds `reward_height`, the one reward term, and `torso_height` [m].

    Args:
        xml: The robot as MJCF text; by default the article's.
        params: The task; by default the article's.
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
        self.params = params or article.ENV
        self.model = robot.load(xml or robot.build(article.ROBOT))
        self.model.vis.global_.offwidth = max(self.model.vis.global_.offwidth, width)
        self.model.vis.global_.offheight = max(self.model.vis.global_.offheight, height)
        self.data = mujoco.MjData(self.model)
        self.metadata = self.metadata | {"render_fps": round(1 / self.dt)}
        self.render_mode = render_mode
        self.observation_space = observation_space()
        self.action_space = action_space(ActionSet())
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


class Decisions(gym.Wrapper):
    """Makes a step one decision of an agent: a choice from its action set, held as long as it says.

    Rewards are sums over the control steps that a decision lasts.

    Args:
        env: A `JumpingAnt`.
        actions: The agent's action set: of an agent of `params.yaml`,
            `ActionSet.of(params.agent("dqn").actions)`.
    """

    def __init__(self, env: gym.Env, actions: ActionSet) -> None:
        super().__init__(env)
        self.actions = actions
        self.action_space = action_space(actions)

    def step(self, action: Any) -> tuple[NDArray[Any], float, bool, bool, dict[str, Any]]:
        """Hold a choice until its time is over or the episode ends.

        Args:
            action: Number of a command, or torques in [-1, 1], shape (8,).

        Returns:
            The last observation, shape (27,), the summed reward, whether the episode terminated or
            was truncated, and the last `info`, its `reward_height` summed.
        """
        torques = self.actions.torques(np.asarray(action)[None])[0]
        total = 0.0
        for _ in range(self.actions.hold):
            observation, reward, terminated, truncated, info = self.env.step(torques)
            total += float(reward)
            if terminated or truncated:
                break
        return observation, total, terminated, truncated, info | {"reward_height": total}


def make_vec(num_envs: int = 1, num_threads: int = 1) -> JumpingAntVectorEnv:
    """Return a batch of the article's jumping Ants, for `gym.make_vec`.

    Args:
        num_envs: Number of environments.
        num_threads: Threads that step them; results do not depend on it.
    """
    return JumpingAntVectorEnv(robot.build(article.ROBOT), article.ENV, num_envs, num_threads)


gym.register(
    ENV_ID,
    entry_point="jumping_ant.sim.env:JumpingAnt",
    vector_entry_point="jumping_ant.sim.env:make_vec",
)
