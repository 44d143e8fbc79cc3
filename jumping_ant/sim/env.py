"""The task as a Gymnasium environment, and `JumpingAnt-v0`.

`gym.make("JumpingAnt-v0")` is always the article's robot and task, regardless of `params.yaml`, and
`gym.make_vec("JumpingAnt-v0", num_envs=n)` is a batch of them on MuJoCo's native threads.

Training, evaluation and populations use the batched `jumping_ant.sim.vector.RobotVectorEnv`; the
single environment is a batch of one, for interactive use and tools.

Observation, action and reward are described in `jumping_ant.sim.task`.
"""

from copy import copy
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import mujoco
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from jumping_ant.params import article
from jumping_ant.policies.actions import ActionSet
from jumping_ant.sim import gl, rewards, robot
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World

if TYPE_CHECKING:  # its imports are needed only for rendering
    from gymnasium.envs.mujoco.mujoco_rendering import MujocoRenderer

ENV_ID = "JumpingAnt-v0"


def article_world() -> World:
    """Return the article's robot and task."""
    return World(robot.build(article.ROBOT), article.ENV)


class RobotEnv(gym.Env[NDArray[Any], NDArray[Any]]):
    """A robot and its task (see `jumping_ant.sim.task`): a batch of one.

    `info` of each step holds `reward_<term>` of every term of the reward, and `torso_height` [m].

    Args:
        world: The robot and the task.
        render_mode: `rgb_array`, `human` or None.
        width: Width of the rendered picture [pixels].
        height: Height of the rendered picture [pixels].
        actions: The set that a step's actions are from, and how many control steps each is held;
            by default torques over peak torques, held for one. For an agent of `params.yaml`:
            `ActionSet.of(params.agent("dqn").actions, params.env.commands)`.

    Attributes:
        envs: The batch.
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
        actions: ActionSet | None = None,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(
                f"render_mode: given {render_mode!r}, allowed: None, "
                f"{', '.join(map(repr, self.metadata['render_modes']))}"
            )
        self.world = world
        self.envs = RobotVectorEnv(world, 1, actions=actions)
        self.task = self.envs.task
        self.metadata = self.metadata | {"render_fps": round(1 / self.envs.dt)}
        self.render_mode = render_mode
        self.observation_space = self.envs.single_observation_space
        self.action_space = self.envs.single_action_space
        self._size = (width, height)
        self._renderer: MujocoRenderer | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Start an episode from a noisy standing pose."""
        super().reset(seed=seed)
        self.envs.generators[0] = self.np_random
        observations, infos = self.envs.reset()
        if self.render_mode == "human":
            self.render()
        return observations[0], {"torso_height": float(infos["torso_height"][0])}

    def step(
        self, action: NDArray[Any]
    ) -> tuple[NDArray[np.float64], float, bool, bool, dict[str, Any]]:
        """Hold an action, or until the episode ends; rewards are sums over the control steps.

        Args:
            action: A choice from the action set (see `RobotVectorEnv.step`), without a row's axis.
        """
        observations, outcome, truncations, heights = self.envs.advance(np.asarray(action)[None])
        if self.render_mode == "human":
            self.render()
        info = {f"{rewards.PREFIX}{name}": float(each[0]) for name, each in outcome.terms.items()}
        return (
            observations[0],
            float(outcome.rewards[0]),
            bool(outcome.terminated[0]),
            bool(truncations[0]),
            info | {"torso_height": float(heights[0])},
        )

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the scene: an array of shape (height, width, 3), or the window."""
        if self.render_mode is None:
            return None
        off_screen = self.render_mode == "rgb_array"
        self._renderer = self._renderer or _renderer(self.world, self._size, off_screen)
        return _picture(self._renderer, self.envs, 0, self.render_mode)

    def close(self) -> None:
        """Close the window or the off-screen context."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def jumping_ant(**settings: Any) -> RobotEnv:
    """Return `JumpingAnt-v0`, the article's robot and task, with settings of `RobotEnv`."""
    return RobotEnv(article_world(), **settings)


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
        renderer = self._renderer = self._renderer or _renderer(self.world, self._size)
        rows = range(self.num_envs)
        return tuple(_picture(renderer, self, row, self.render_mode).copy() for row in rows)

    def close_extras(self, **kwargs: Any) -> None:
        """Close the off-screen context."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def _renderer(world: World, size: tuple[int, int], off_screen: bool = True) -> "MujocoRenderer":
    model = copy(world.model)  # as sizes of pictures are written to it
    return gl.gymnasium_renderer(model, mujoco.MjData(model), *size, off_screen=off_screen)


def _picture(renderer: "MujocoRenderer", envs: RobotVectorEnv, row: int, mode: str) -> Any:
    envs.batch.get_data(row, renderer.data)
    mujoco.mj_forward(renderer.model, renderer.data)
    return renderer.render(mode)


gym.register(
    ENV_ID,
    entry_point="jumping_ant.sim.env:jumping_ant",
    vector_entry_point="jumping_ant.sim.env:JumpingAntVector",
)
