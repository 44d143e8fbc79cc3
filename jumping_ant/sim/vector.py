"""Many jumping Ants stepped together on MuJoCo's native thread pool.

This is the one simulator core: training, populations and evaluation all step it. Environment `i`
draws its episodes' noise from a generator of its own, seeded with the `i`-th of the seeds given, so
no result depends on how many environments run together or on how many threads.
"""

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from mujoco import mjtStage
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from jumping_ant.actions import ActionSet
from jumping_ant.params.models import EnvParams
from jumping_ant.sim import robot
from jumping_ant.sim.rewards import is_down, torso_height_reward
from jumping_ant.sim.task import action_space, observation_space, observe, start_state


class JumpingAntVectorEnv(VectorEnv[NDArray[np.float64], NDArray[Any], NDArray[Any]]):
    """A batch of `JumpingAnt` environments with Gymnasium's vector API.

    Autoreset is `AutoresetMode.SAME_STEP` by default: an episode that ends is replaced in the same
    step, its last observation stands in `infos["final_obs"]` and its step's info in
    `infos["final_info"]`. With `AutoresetMode.DISABLED` ended environments simulate on, and
    `reset(options={"reset_mask": ...})` restarts those of a mask.

    Args:
        xml: The robot as MJCF text.
        params: The task.
        num_envs: Number of environments.
        num_threads: Threads that step them; results do not depend on it.
        autoreset_mode: SAME_STEP or DISABLED.
        actions: What a step's actions are, and how many control steps it holds them for.
        episode_steps: Control steps after which each environment's episodes are truncated, shape
            (num_envs,), infinite for never; by default `params.max_episode_steps`.
        tumbled_starts: Share of the episodes that start tumbled (see `task.start_state`).

    Attributes:
        generators: Where each environment's noise comes from.

    Raises:
        InputError: The XML is not a robot with the Ant's joints.
        ValueError: The autoreset mode is not one of the two.
    """

    def __init__(
        self,
        xml: str,
        params: EnvParams,
        num_envs: int,
        num_threads: int = 1,
        autoreset_mode: AutoresetMode = AutoresetMode.SAME_STEP,
        actions: ActionSet | None = None,
        episode_steps: NDArray[np.float64] | None = None,
        tumbled_starts: float = 0.0,
    ) -> None:
        if autoreset_mode not in (AutoresetMode.SAME_STEP, AutoresetMode.DISABLED):
            raise ValueError(
                f"autoreset_mode: given {autoreset_mode}, allowed: SAME_STEP, DISABLED"
            )
        self.params = params
        self.model = robot.load(xml)
        self.num_envs = num_envs
        self.metadata = {"autoreset_mode": autoreset_mode}
        self.single_observation_space = observation_space()
        self.actions = actions or ActionSet()
        self.single_action_space = action_space(self.actions)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._autoreset = autoreset_mode is AutoresetMode.SAME_STEP
        self._batch = Batch(self.model, num_envs, num_threads)
        self.qpos = self._batch.bind("qpos")
        self.qvel = self._batch.bind("qvel")
        self._ctrl = self._batch.bind("ctrl")
        self._contacts = self._batch.bind("ncon")
        self.generators = [np.random.default_rng() for _ in range(num_envs)]
        self._num_steps = np.zeros(num_envs, dtype=np.int64)
        self._tumbled_starts = tumbled_starts
        limit = np.full(num_envs, params.max_episode_steps)
        self._episode_steps = limit if episode_steps is None else episode_steps

    @property
    def dt(self) -> float:
        """Duration of a control step [s]."""
        return float(self.model.opt.timestep) * self.params.frame_skip

    @property
    def airborne(self) -> NDArray[np.bool_]:
        """Whether each robot touches nothing, as of the last simulation step, (num_envs,)."""
        return self._contacts == 0

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Start an episode in every environment, or in those of `options["reset_mask"]`.

        Args:
            seed: Environment `i` is seeded with `seed + i`, or with `seed[i]`; None leaves
                the generators as they are.
            options: `{"reset_mask": mask}` with a boolean mask of shape (num_envs,).

        Returns:
            Observations, shape (num_envs, 27), and info.

        Raises:
            ValueError: As many seeds as environments are needed.
        """
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
        mask = (options or {}).get("reset_mask", np.ones(self.num_envs, dtype=np.bool_))
        if seeds is not None:
            if len(seeds) != self.num_envs:
                raise ValueError(f"seed: given {len(seeds)} seeds, allowed: {self.num_envs}")
            for index, own_seed in enumerate(seeds):
                if mask[index] and own_seed is not None:
                    self.generators[index], _ = gym.utils.seeding.np_random(own_seed)
        self._start_episodes(np.flatnonzero(mask))
        return observe(self.qpos, self.qvel), {"torso_height": self.qpos[:, 2].copy()}

    def step(
        self, actions: NDArray[Any]
    ) -> tuple[
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.bool_],
        NDArray[np.bool_],
        dict[str, Any],
    ]:
        """Hold each row's action for `actions.hold` control steps.

        Of an environment whose episode ends within them, that end is returned.

        Args:
            actions: Torques in [-1, 1], shape (num_envs, 8), or commands, shape (num_envs,).

        Returns:
            Observations (num_envs, 27), rewards, terminations and truncations (num_envs,), and
            `infos` with `reward_height` and `torso_height` [m], both (num_envs,). Rewards are sums
            over the control steps.
        """
        self._ctrl[:] = self.actions.torques(actions)
        observations, rewards, terminations, truncations = self._control_step()
        heights = self.qpos[:, 2].copy()
        for _ in range(self.actions.hold - 1):
            alive = ~(terminations | truncations)
            if not alive.any():
                break
            after, reward, terminated, truncated = self._control_step()
            observations[alive], heights[alive] = after[alive], self.qpos[alive, 2]
            rewards[alive] += reward[alive]
            terminations[alive], truncations[alive] = terminated[alive], truncated[alive]
        infos: dict[str, Any] = {"reward_height": rewards.copy(), "torso_height": heights}
        done = terminations | truncations
        if self._autoreset and done.any():
            final = np.full(self.num_envs, None, dtype=object)
            for index in np.flatnonzero(done):
                final[index] = observations[index].copy()
            last = {key: np.where(done, value, 0.0) for key, value in infos.items()}
            infos |= {"final_obs": final, "_final_obs": done}
            infos |= {"final_info": last, "_final_info": done}
            self._start_episodes(np.flatnonzero(done))
            observations[done] = observe(self.qpos[done], self.qvel[done])
        return observations, rewards, terminations, truncations, infos

    def _control_step(
        self,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]:
        """Simulate one control step; return observations, rewards and both kinds of end."""
        try:
            self._batch.step(nstep=self.params.frame_skip)
        except SimulationError as error:  # MuJoCo gave up on these: their episodes end, alone
            self.qpos[error.ids] = np.nan
        self._num_steps += 1
        rewards = torso_height_reward(self.qpos[:, 2], self.params.reward)
        terminations = is_down(self.qpos, self.qvel, self.params.min_torso_height)
        truncations = ~terminations & (self._num_steps >= self._episode_steps)
        return observe(self.qpos, self.qvel), rewards, terminations, truncations

    def save_state(self) -> dict[str, Any]:
        """Return all that later steps depend on: arrays, and what JSON can express."""
        return {
            "physics": self._batch.state.copy(),
            "num_steps": self._num_steps.copy(),
            "generators": [generator.bit_generator.state for generator in self.generators],
        }

    def load_state(self, state: dict[str, Any]) -> None:
        """Resume from a state of as many environments.

        `airborne` tells of the contacts of the last step, and so nothing until the next.
        """
        self._batch.state[:] = state["physics"]
        self._num_steps[:] = state["num_steps"]
        for generator, own in zip(self.generators, state["generators"], strict=True):
            generator.bit_generator.state = own

    def _start_episodes(self, indices: NDArray[np.int64]) -> None:
        if len(indices) == 0:
            return
        self._batch.reset(indices, stage=mjtStage.mjSTAGE_NONE)
        for index in indices:
            self.qpos[index], self.qvel[index] = start_state(
                self.model,
                self.params.reset_noise_scale,
                self.generators[index],
                self._tumbled_starts,
            )
        self._batch.forward(indices)
        self._num_steps[indices] = 0
