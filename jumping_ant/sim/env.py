"""The task as a Gymnasium environment, and `JumpingAnt-v0`.

`gym.make("JumpingAnt-v0")` is always the article's robot and task, regardless of `params.yaml`, and
`gym.make_vec("JumpingAnt-v0", num_envs=n)` is a batch of them on MuJoCo's native threads.

Training, evaluation and populations use the batched `jumping_ant.sim.vector.RobotVectorEnv`; this
one is for interactive use and tools. Tests check that the two are bit-identical.

Observation, action and reward are described in `jumping_ant.sim.task`.
"""

from copy import copy
from typing import TYPE_CHECKING, Any, cast

import gymnasium as gym
import mujoco
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from jumping_ant.actions import ActionSet
from jumping_ant.params import article
from jumping_ant.sim import gl, rewards, robot
from jumping_ant.sim.task import Task, action_space
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World

if TYPE_CHECKING:  # its imports are needed only for rendering
    from gymnasium.envs.mujoco.mujoco_rendering import MujocoRenderer

ENV_ID = "JumpingAnt-v0"


def article_world() -> World:
    """Return the article's robot and task."""
    return World(robot.build(article.ROBOT), article.ENV)


class RobotEnv(gym.Env[NDArray[Any], NDArray[Any]]):
    """A robot and its task (see `jumping_ant.sim.task`).

    `info` of each step holds `reward_<term>` of every term of the reward, and `torso_height` [m].

    Args:
        world: The robot and the task.
        render_mode: `rgb_array`, `human` or None.
        width: Width of the rendered picture [pixels].
        height: Height of the rendered picture [pixels].

    Attributes:
        model: The compiled robot, which is this environment's own.
        task: The task, with the robot's anatomy.

    Raises:
        InputError: The XML is not a robot, or the task does not fit it.
        ValueError: There is no such render mode.
    """

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": 20}

    def __init__(
        self,
        world: World,
        render_mode: str | None = None,
        width: int = 480,
        height: int = 480,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(
                f"render_mode: given {render_mode!r}, allowed: None, "
                f"{', '.join(map(repr, self.metadata['render_modes']))}"
            )
        self.world = world
        self.model = copy(world.model)
        self.data = mujoco.MjData(self.model)
        self.task = Task(world)
        self.metadata = self.metadata | {"render_fps": round(1 / self.dt)}
        self.render_mode = render_mode
        self.observation_space = self.task.observation_space
        self.action_space = self.task.action_space(ActionSet())
        self._size = (width, height)
        self._renderer: MujocoRenderer | None = None
        self._num_steps = 0

    @property
    def dt(self) -> float:
        """Duration of a control step [s]."""
        return self.task.dt

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Start an episode from a noisy standing pose."""
        super().reset(seed=seed)
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = self.task.start_state(self.np_random)
        mujoco.mj_forward(self.model, self.data)
        self._num_steps = 0
        if self.render_mode == "human":
            self.render()
        return self._observation(), self._info()

    def step(
        self, action: NDArray[Any]
    ) -> tuple[NDArray[np.float64], float, bool, bool, dict[str, Any]]:
        """Hold torques for one control step.

        Args:
            action: Torques over peak torques in [-1, 1], shape (num_motors,).
        """
        torques = np.asarray(action, dtype=np.float64)
        self.data.ctrl[:] = torques * self.task.anatomy.control_limits
        before = self._torso_x()
        mujoco.mj_step(self.model, self.data, nstep=self.world.env.frame_skip)
        self._num_steps += 1
        data, travel = self.data, np.array([self._torso_x() - before])
        contacts = np.array([data.ncon], dtype=np.int32)
        outcome = self.task.judge(data.qpos[None], data.qvel[None], torques[None], travel, contacts)
        terminated = bool(outcome.terminated[0])
        truncated = not terminated and self._num_steps >= self.world.env.max_episode_steps
        if self.render_mode == "human":
            self.render()
        terms = {f"{rewards.PREFIX}{name}": float(each[0]) for name, each in outcome.terms.items()}
        info = terms | self._info()
        return self._observation(), float(outcome.rewards[0]), terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the scene: an array of shape (height, width, 3), or the window."""
        if self.render_mode is None:
            return None
        if self._renderer is None:
            self._renderer = gl.gymnasium_renderer(
                self.model, self.data, *self._size, off_screen=self.render_mode == "rgb_array"
            )
        return self._renderer.render(self.render_mode)

    def close(self) -> None:
        """Close the window or the off-screen context."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _observation(self) -> NDArray[np.float64]:
        return self.task.observe(self.data.qpos[None], self.data.qvel[None])[0]

    def _info(self) -> dict[str, Any]:
        return {"torso_height": float(self.task.anatomy.heights(self.data.qpos[None])[0])}

    def _torso_x(self) -> float:
        return float(self.data.xpos[self.task.anatomy.torso, 0])


class JumpingAnt(RobotEnv):
    """`JumpingAnt-v0`: the article's robot and task.

    Args:
        render_mode: `rgb_array`, `human` or None.
        width: Width of the rendered picture [pixels].
        height: Height of the rendered picture [pixels].
    """

    def __init__(self, render_mode: str | None = None, width: int = 480, height: int = 480) -> None:
        super().__init__(article_world(), render_mode, width, height)


class Decisions(gym.Wrapper):
    """Makes each step one decision of an agent: a choice from its action set, held as it specifies.

    Rewards are sums over the control steps of a decision.

    Args:
        env: An environment whose actions are torques, such as `RobotEnv`.
        actions: The agent's action set; for an agent of `params.yaml`,
            `ActionSet.of(params.agent("dqn").actions, params.env.commands)`.
    """

    def __init__(self, env: gym.Env, actions: ActionSet) -> None:
        super().__init__(env)
        self.actions = actions
        self.action_space = action_space(actions, cast(gym.spaces.Box, env.action_space).shape[0])

    def step(self, action: Any) -> tuple[NDArray[Any], float, bool, bool, dict[str, Any]]:
        """Hold a choice for its duration or until the episode ends.

        Args:
            action: Number of a command, or torques in [-1, 1] or levels' indices, (num_motors,).

        Returns:
            The last observation, shape (num_observations,), the summed reward, whether the episode
            terminated or was truncated, and the last `info`, with the reward terms summed.
        """
        torques = self.actions.torques(np.asarray(action)[None])[0]
        total, terms = 0.0, dict[str, float]()
        for _ in range(self.actions.hold):
            observation, reward, terminated, truncated, info = self.env.step(torques)
            total += float(reward)
            for key in info:
                if key.startswith(rewards.PREFIX):
                    terms[key] = terms.get(key, 0.0) + info[key]
            if terminated or truncated:
                break
        return observation, total, terminated, truncated, info | terms


class JumpingAntVector(RobotVectorEnv):
    """A batch of `JumpingAnt-v0`, as `gym.make_vec` returns it.

    Args:
        num_envs: Number of environments.
        num_threads: Threads that step them; results do not depend on it.
        autoreset_mode: What happens after the end of an episode.
        render_mode: `rgb_array` or None.
        width: Width of the rendered pictures [pixels].
        height: Height of the rendered pictures [pixels].

    Raises:
        ValueError: There is no such render mode.
    """

    def __init__(
        self,
        num_envs: int = 1,
        num_threads: int = 1,
        autoreset_mode: AutoresetMode = AutoresetMode.SAME_STEP,
        render_mode: str | None = None,
        width: int = 480,
        height: int = 480,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode: given {render_mode!r}, allowed: None, 'rgb_array'")
        super().__init__(article_world(), num_envs, num_threads, AutoresetMode(autoreset_mode))
        self.metadata |= {"render_modes": ["rgb_array"], "render_fps": round(1 / self.dt)}
        self.render_mode = render_mode
        self._size = (width, height)
        self._renderer: MujocoRenderer | None = None

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Draw each environment: pictures of shape (height, width, 3)."""
        if self.render_mode is None:
            return None
        if self._renderer is None:
            model = self.world.model
            self._renderer = gl.gymnasium_renderer(model, mujoco.MjData(model), *self._size)
        pictures = []
        for index in range(self.num_envs):
            self.batch.get_data(index, self._renderer.data)
            mujoco.mj_forward(self.world.model, self._renderer.data)
            pictures.append(self._renderer.render("rgb_array").copy())
        return tuple(pictures)

    def close_extras(self, **kwargs: Any) -> None:
        """Close the off-screen context."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


gym.register(
    ENV_ID,
    entry_point="jumping_ant.sim.env:JumpingAnt",
    vector_entry_point="jumping_ant.sim.env:JumpingAntVector",
)
