"""The task as a Gymnasium environment, and `JumpingAnt-v0`.

`gym.make("JumpingAnt-v0")` is always the article's robot and task, regardless of `params.yaml`, and
`gym.make_vec("JumpingAnt-v0", num_envs=n)` is a batch of them on MuJoCo's native threads.
Observation, action and reward are described in `jumping_ant.sim.task`.
"""

from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
from numpy.typing import NDArray

from jumping_ant.params import article
from jumping_ant.policies.actions import ActionSet
from jumping_ant.sim import gl, rewards, robot
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World

ENV_ID = "JumpingAnt-v0"
MOST_STEPS = article.ENV.max_episode_steps  # [control steps] of an episode


class DrawnVectorEnv(RobotVectorEnv):
    """A batch of environments that can be drawn.

    Args:
        world: The robot and the task.
        num_envs: Number of environments.
        render_mode: `rgb_array`, `human` for a window on a batch of one, or None.
        width: Width of the pictures [pixels].
        height: Height of the pictures [pixels].
        settings: Others of `RobotVectorEnv`.
    """

    def __init__(
        self,
        world: World,
        num_envs: int = 1,
        render_mode: str | None = None,
        width: int = 480,
        height: int = 480,
        **settings: Any,
    ) -> None:
        super().__init__(world, num_envs, **settings)
        self.metadata |= {
            "render_modes": ["rgb_array"],
            "render_fps": 1 / (self.dt * self.actions.hold),
        }
        self.render_mode = render_mode
        self._size = (width, height)
        self._renderer: Any = None

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Draw each environment: pictures of shape (height, width, 3)."""
        if self.render_mode is None:
            return None
        if self._renderer is None:
            off_screen = self.render_mode == "rgb_array"
            self._renderer = gl.gymnasium_renderer(self.world.model, *self._size, off_screen)
        return tuple(self._draw(row) for row in range(self.num_envs))

    def _draw(self, row: int) -> Any:
        renderer = self._renderer
        self.batch.get_data(row, renderer.data)
        mujoco.mj_forward(renderer.model, renderer.data)
        return renderer.render(self.render_mode)

    def close_extras(self, **kwargs: Any) -> None:
        """Close the window or the off-screen context."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


class RobotEnv(gym.Env[NDArray[Any], NDArray[Any]]):
    """A robot and its task: a batch of one, for interactive use and tools.

    `info` of each step holds `reward_<term>` of every term of the reward, and `torso_height` [m].

    Args:
        world: The robot and the task.
        render_mode: `rgb_array`, `human` or None.
        settings: Others of `DrawnVectorEnv`. `actions` makes it that of an agent of `params.yaml`:
            `ActionSet.of(params.agent("dqn").actions, params.env.commands)`.
        dtype: Of observations.
    """

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": 20}

    def __init__(
        self,
        world: World,
        render_mode: str | None = None,
        dtype: type[np.floating[Any]] = np.float64,
        **settings: Any,
    ) -> None:
        self.world = world
        self.render_mode = render_mode
        self._settings = settings
        self.envs = self._simulation()
        self.metadata = self.metadata | {"render_fps": self.envs.metadata["render_fps"]}
        shape = self.envs.single_observation_space.shape
        self.observation_space = gym.spaces.Box(-np.inf, np.inf, shape, dtype)
        self.action_space = self.envs.single_action_space

    def _simulation(self) -> DrawnVectorEnv:
        return DrawnVectorEnv(self.world, render_mode=self.render_mode, **self._settings)

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy needs, here or in another process: MuJoCo's batch cannot be copied."""
        return vars(self) | {"envs": self.envs.save_state()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Simulate anew from the state of the environment that was copied."""
        vars(self).update(state)
        self.envs = self._simulation()
        self.envs.generators[0] = self.np_random
        self.envs.load_state(state["envs"])

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.floating[Any]], dict[str, Any]]:
        """Start an episode from a noisy standing pose."""
        super().reset(seed=seed)
        self.envs.generators[0] = self.np_random
        observations, infos = self.envs.reset()
        if self.render_mode == "human":
            self.render()
        return self._observed(observations), {"torso_height": float(infos["torso_height"][0])}

    def step(
        self, action: NDArray[Any]
    ) -> tuple[NDArray[np.floating[Any]], float, bool, bool, dict[str, Any]]:
        """Hold an action, or until the episode ends; rewards are sums over the control steps.

        Args:
            action: A choice from the action set (see `RobotVectorEnv.step`), without a row's axis.
        """
        observations, outcome, truncations, heights = self.envs.advance(np.asarray(action)[None])
        if self.render_mode == "human":
            self.render()
        info = {f"{rewards.PREFIX}{name}": float(each[0]) for name, each in outcome.terms.items()}
        return (
            self._observed(observations),
            float(outcome.rewards[0]),
            bool(outcome.terminated[0]),
            bool(truncations[0]),
            info | {"torso_height": float(heights[0])},
        )

    def _observed(self, observations: NDArray[np.float64]) -> NDArray[np.floating[Any]]:
        row: NDArray[np.floating[Any]] = observations[0].astype(self.observation_space.dtype)
        return row

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the scene: an array of shape (height, width, 3), or the window."""
        pictures = self.envs.render()
        return None if pictures is None else pictures[0]

    def close(self) -> None:
        """Close the window or the off-screen context."""
        self.envs.close_extras()


def article_world() -> World:
    """Return the article's robot and task."""
    return World(robot.build(article.ROBOT), article.ENV)


def jumping_ant(**settings: Any) -> RobotEnv:
    """Return `JumpingAnt-v0`, with settings of `RobotEnv`.

    With an agent's `actions` its observations are float32, as the policies of Stable-Baselines3
    expect that are loaded with an environment.
    """
    dtype = np.float32 if settings.get("actions") else np.float64
    return RobotEnv(article_world(), **{"dtype": dtype} | settings)


def jumping_ants(
    num_envs: int = 1, max_episode_steps: int | None = None, **settings: Any
) -> DrawnVectorEnv:
    """Return a batch of `JumpingAnt-v0`, with settings of `DrawnVectorEnv`.

    `max_episode_steps` are decisions, of `actions.hold` control steps, as Gymnasium's time limit
    counts them.
    """
    hold = (settings.get("actions") or ActionSet()).hold
    limits = [MOST_STEPS] + [hold * steps for steps in [max_episode_steps or 0] if steps > 0]
    settings = {"episode_steps": np.full(num_envs, min(limits))} | settings
    return DrawnVectorEnv(article_world(), num_envs, **settings)


gym.register(
    ENV_ID,
    max_episode_steps=MOST_STEPS,
    entry_point="jumping_ant.sim.env:jumping_ant",
    vector_entry_point="jumping_ant.sim.env:jumping_ants",
)
