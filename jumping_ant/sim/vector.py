"""Many robots stepped together on MuJoCo's native thread pool.

Training, populations and evaluation all use it. Environment `i` draws its episodes' noise from a
generator seeded with the `i`-th seed, so results depend neither on the number of environments that
run together nor on the number of threads.
"""

from collections.abc import Callable, Sequence
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from jumping_ant.base.errors import InputError
from jumping_ant.policies.actions import ActionSet
from jumping_ant.sim import rewards
from jumping_ant.sim.task import Outcome, Task
from jumping_ant.sim.world import World

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class RobotVectorEnv(VectorEnv[Array, NDArray[Any], NDArray[Any]]):
    """A batch of environments with Gymnasium's vector API.

    The contents of `infos` and its masks `_<key>` are those of `SyncVectorEnv` in each autoreset
    mode:

    - SAME_STEP: an episode that ends is replaced in the same step; its last observation is in
      `infos["final_obs"]` and its last info in `infos["final_info"]`.
    - NEXT_STEP: the step after an end ignores the action and starts an episode instead.
    - DISABLED: ended environments stand still until `reset(options={"reset_mask": ...})`.

    Args:
        world: The robot and the task.
        num_envs: Number of environments.
        num_threads: Threads that step them; results do not depend on it.
        autoreset_mode: What happens after the end of an episode.
        actions: The set that actions are from, and how many control steps they are held; by default
            torques over peak torques, held for one.
        episode_steps: Control steps after which each environment's episodes are truncated, shape
            (num_envs,), infinite for never; by default `env.max_episode_steps`.
        tumbled_starts: Share of the episodes that start tumbled (see `Task.start_state`).

    Raises:
        InputError: The XML is not a robot, or the task does not fit it.
    """

    def __init__(
        self,
        world: World,
        num_envs: int,
        num_threads: int = 1,
        autoreset_mode: AutoresetMode = AutoresetMode.SAME_STEP,
        actions: ActionSet | None = None,
        episode_steps: NDArray[Any] | None = None,
        tumbled_starts: float = 0.0,
    ) -> None:
        self.world = world
        self.task = Task(world)
        self.num_envs = num_envs
        self.metadata = {"autoreset_mode": autoreset_mode}
        self.single_observation_space = self.task.observation_space
        self.actions = actions or ActionSet()
        self.single_action_space = self.task.action_space(self.actions)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._autoreset = autoreset_mode
        self.generators = [np.random.default_rng() for _ in range(num_envs)]  # of start states
        self.batch = Batch(world.model, num_envs, num_threads)
        self.qpos = self.batch.bind("qpos")
        self.qvel = self.batch.bind("qvel")
        self._ctrl = self.batch.bind("ctrl")
        self._contacts = self.batch.bind("ncon")
        self._torso_x = self.batch.bind("xpos")[:, self.task.anatomy.torso, 0]
        # Perturbations change start states, torques over peak torques (num_envs, num_motors), and
        # observations. They need a batch without autoreset that is always reset as a whole.
        self.on_reset: list[Callable[[], None]] = []
        self.before_step: list[Callable[[Array], Array]] = []
        self.on_observe: list[Callable[[Array], Array]] = []
        self._last_x = self._torso_x.copy()  # saved separately: MuJoCo's `xpos` is a substep late
        self._is_started = False
        self.num_steps = np.zeros(num_envs, dtype=np.int64)  # control steps of each episode so far
        self.cut_steps = 0  # so far, that decisions had left when a robot fell
        self._has_ended = np.zeros(num_envs, dtype=np.bool_)
        self._tumbled_starts = tumbled_starts
        limit = np.full(num_envs, world.env.max_episode_steps)
        self._episode_steps = limit if episode_steps is None else episode_steps

    @property
    def dt(self) -> float:
        """Duration of a control step [s]."""
        return self.task.dt

    @property
    def airborne(self) -> Mask:
        """Whether each robot touches nothing, as of the last simulation step, (num_envs,)."""
        return self._contacts == 0

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Array, dict[str, Any]]:
        """Start an episode in every environment, or in those of `options["reset_mask"]`.

        Args:
            seed: Environment `i` is seeded with `seed + i`, or with `seed[i]`; None leaves
                the generators as they are.
            options: `{"reset_mask": mask}` with a boolean mask of shape (num_envs,).

        Returns:
            Observations, shape (num_envs, num_observations), and infos with `torso_height` [m].
        """
        seeds = range(seed, seed + self.num_envs) if isinstance(seed, int) else seed
        everywhere = np.ones(self.num_envs, dtype=np.bool_)
        mask = np.asarray((options or {}).get("reset_mask", everywhere))
        if (mask.shape, mask.dtype) != (everywhere.shape, everywhere.dtype):
            given, allowed = f"{mask.dtype} of shape {mask.shape}", f"bool of {everywhere.shape}"
            raise InputError(f"reset_mask: given {given}, allowed: {allowed}")
        if seeds is not None:
            self.generators = [
                gym.utils.seeding.np_random(start)[0] if chosen and start is not None else old
                for old, chosen, start in zip(self.generators, mask, seeds, strict=True)
            ]
        self._is_started |= bool(mask.any())
        self._start_episodes(np.flatnonzero(mask))
        for disturb in self.on_reset:
            disturb()
            self._last_x = self._torso_x.copy()
        return self._observe(), _masked({"torso_height": self._heights()}, mask)

    def step(self, actions: NDArray[Any]) -> tuple[Array, Array, Mask, Mask, dict[str, Any]]:
        """Hold each row's action for `actions.hold` control steps.

        If an environment's episode ends within them, the step returns the values at that end.

        Args:
            actions: Choices from the action set: torques in [-1, 1] or indices of levels, shape
                (num_envs, num_motors), or commands, (num_envs,).

        Returns:
            Observations (num_envs, num_observations), rewards, terminations and truncations
            (num_envs,), and infos with `reward_<term>` and `torso_height` [m], (num_envs,) each.
            Rewards are sums over the control steps.
        """
        actions = self._checked(actions)
        everywhere = continued = np.ones(self.num_envs, dtype=np.bool_)
        resting = self._has_ended.copy()
        if self._autoreset is AutoresetMode.NEXT_STEP:
            continued = ~resting
            self._start_episodes(np.flatnonzero(resting))
        observations, outcome, truncations, heights = self.advance(actions, resting)
        outcome.rewards[~continued] = 0.0
        outcome.terminated[~continued] = truncations[~continued] = False
        done = outcome.terminated | truncations
        self._has_ended |= done
        terms = {f"{rewards.PREFIX}{name}": values for name, values in outcome.terms.items()}
        infos: dict[str, Any] = {}
        if self._autoreset is AutoresetMode.SAME_STEP and done.any():
            final = np.full(self.num_envs, None, dtype=object)
            for index in np.flatnonzero(done):
                final[index] = observations[index].copy()
            infos = {"final_obs": final, "_final_obs": done, "_final_info": done}
            infos["final_info"] = _masked(terms | {"torso_height": heights}, done)
            self._start_episodes(np.flatnonzero(done))
            observations[done] = self.task.observe(self.qpos[done], self.qvel[done])
            heights[done] = self._heights()[done]
            continued = ~done
        infos |= _masked(terms, continued) | _masked({"torso_height": heights}, everywhere)
        return observations, outcome.rewards, outcome.terminated, truncations, infos

    def advance(
        self, actions: NDArray[Any], resting: Mask | None = None
    ) -> tuple[Array, Outcome, Mask, Array]:
        """Hold each row's action as `step` does, but start no episodes.

        Args:
            actions: As in `step`.
            resting: Environments that stand still, shape (num_envs,); by default none.

        Returns:
            Observations, the outcome, truncations, and heights of the torsos [m].

        Raises:
            InputError: Actions of another shape, or indices that stand for nothing.
            ResetNeeded: No episode has been started.
        """
        actions = self._checked(actions)
        resting = np.zeros(self.num_envs, dtype=np.bool_) if resting is None else resting
        torques = np.asarray(self.actions.torques(actions), dtype=np.float64)
        before = self.num_steps.copy()
        observations, outcome, truncations = self._control_step(torques, resting)
        heights = self._heights()
        for _ in range(self.actions.hold - 1):
            alive = ~(outcome.terminated | truncations | resting)
            if not alive.any():
                break
            after, then, truncated = self._control_step(torques, ~alive)
            observations[alive], heights[alive] = after[alive], self._heights()[alive]
            outcome.rewards[alive] += then.rewards[alive]
            for name, values in outcome.terms.items():
                values[alive] += then.terms[name][alive]
            outcome.terminated[alive] = then.terminated[alive]
            truncations[alive] = truncated[alive]
        left = self.actions.hold - (self.num_steps - before)
        self.cut_steps += int(left[outcome.terminated & ~resting].sum())
        return observations, outcome, truncations, heights

    def _checked(self, actions: NDArray[Any]) -> NDArray[Any]:
        if not self._is_started:
            raise ResetNeeded("step: given no episode, allowed: after reset")
        actions = np.asarray(actions)
        if actions.shape != (allowed := (self.num_envs, *(self.single_action_space.shape or ()))):
            raise InputError(f"actions: given shape {actions.shape}, allowed: {allowed}")
        return actions

    def _control_step(self, torques: Array, resting: Mask) -> tuple[Array, Outcome, Mask]:
        for change in self.before_step:
            torques = change(torques)
        self._ctrl[:] = torques * self.task.anatomy.control_limits
        before = self._last_x
        self._simulate(resting)
        self.num_steps += ~resting
        self._last_x = self._torso_x.copy()
        travel = self._last_x - before
        outcome = self.task.judge(self.qpos, self.qvel, torques, travel, self._contacts)
        truncations = ~outcome.terminated & (self.num_steps >= self._episode_steps)
        return self._observe(), outcome, truncations

    def _simulate(self, resting: Mask) -> None:
        """Advance the other simulations; positions of those that MuJoCo gives up become NaN."""
        if (rows := np.flatnonzero(~resting)).size:
            try:
                self.batch.step(rows, nstep=self.world.env.frame_skip)
            except SimulationError as error:
                self.qpos[error.ids] = np.nan

    def _observe(self) -> Array:
        observations = self.task.observe(self.qpos, self.qvel)
        for change in self.on_observe:
            observations = change(observations)
        return observations

    def save_state(self) -> dict[str, Any]:
        """Return everything that later steps depend on: arrays and JSON values."""
        return {
            "physics": self.batch.state.copy(),
            "torso_x": self._last_x.copy(),
            "num_steps": self.num_steps.copy(),
            "cut_steps": self.cut_steps,
            "has_ended": self._has_ended.copy(),
            "generators": [generator.bit_generator.state for generator in self.generators],
        }

    def load_state(self, state: dict[str, Any]) -> None:
        """Resume from a state of as many environments; `airborne` is known after a step."""
        self.batch.state[:] = state["physics"]
        self._last_x = state["torso_x"].copy()
        self.num_steps[:] = state["num_steps"]
        self.cut_steps, self._is_started = state["cut_steps"], True
        self._has_ended = state["has_ended"].copy()
        for generator, saved in zip(self.generators, state["generators"], strict=True):
            generator.bit_generator.state = saved

    def _heights(self) -> Array:
        return self.task.anatomy.heights(self.qpos)

    def _start_episodes(self, indices: NDArray[np.int64]) -> None:
        if len(indices) == 0:
            return
        self.batch.reset(indices, stage=mujoco.mjtStage.mjSTAGE_NONE)
        for index in indices:
            self.qpos[index], self.qvel[index] = self.task.start_state(
                self.generators[index], self._tumbled_starts
            )
        self.batch.forward(indices)
        self._last_x[indices] = self._torso_x[indices]
        self.num_steps[indices] = 0
        self._has_ended[indices] = False


def _masked(infos: dict[str, Array], mask: Mask) -> dict[str, Any]:
    """Return infos as Gymnasium does: zero outside the mask, and the mask; none if it is empty."""
    masked: dict[str, Any] = {}
    for key, values in infos.items() if mask.any() else ():
        masked |= {key: np.where(mask, values, 0.0), f"_{key}": mask}
    return masked
