"""One robot in the native simulator, a simulation step at a time: perturbed, pushed and pulled.

It is to the live page what `jumping_ant/play/simulation.js` is. Perturbations are those that the
robustness stage would give an episode from the same start.
"""

from collections.abc import Mapping
from copy import copy
from operator import attrgetter
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from jumping_ant.policies.policy import Policy
from jumping_ant.robustness.perturbations import (
    PHYSICS,
    Condition,
    Simulations,
    direction,
    generator,
)
from jumping_ant.robustness.perturbed import PUSH_PERIOD, VELOCITY_NOISE
from jumping_ant.sim.task import Task
from jumping_ant.sim.world import World

Array = NDArray[np.float64]
Json = dict[str, Any]

PULL_RATE = 12.0  # [rad/s] of the undamped spring that pulls the torso, whatever the robot's mass
SHOVE_SECONDS = 0.05
DIGITS = 5  # of places [m] and turns that are drawn


class Simulation:
    """An episode.

    Args:
        world: The robot and the task.
        policy: What drives it.
        start: Its `qpos` and `qvel` at first, and the episode's `seed`.
        levels: Levels of perturbations, by name.

    Attributes:
        target: Where the torso is pulled to [m], (3,), or None.
        substep: How many simulation steps of the present control step are done.
        num_steps: Number of control steps that are done.
        total: Return so far.
        has_ended: Whether the episode has.
    """

    def __init__(
        self, world: World, policy: Policy, start: Json, levels: Mapping[str, float]
    ) -> None:
        self.world, self.policy, self.start = world, policy, start
        self._task, self._anatomy = Task(world), world.anatomy
        self.data = mujoco.MjData(world.model)
        self.data.qpos[:], self.data.qvel[:] = start["qpos"], start["qvel"]
        self.target: Array | None = None
        self._shove, self._push = np.zeros(3), np.zeros(3)
        self._shove_left = 0  # [simulation steps]
        self.substep = self.num_steps = 0
        self.total, self.has_ended = 0.0, False
        self._seen: list[Array] = []
        self._sent: list[Array] = []
        self._choice = self._torques = np.zeros(self._anatomy.num_motors)
        self.perturb(levels)
        mujoco.mj_forward(self.model, self.data)
        policy.start([start["seed"]])
        self._sense()
        self._reports = [self._judge(0.0)[0]]
        self._previous = self._pose = self._look_at()

    def perturb(self, levels: Mapping[str, float]) -> None:
        """Set the levels of perturbations, by name; what is not named is as usual."""
        seed, self._levels = self.start["seed"], dict(levels)
        self._draws = {
            name: generator(Condition(name, level), seed) for name, level in levels.items()
        }
        self.model = copy(self.world.model)
        for name in (own for own in PHYSICS if own in levels):
            batch, level = _BatchOfOne(self.model), np.array([levels[name]])
            rows, draws = np.array([0]), [self._draws[name]]
            PHYSICS[name](Simulations(batch, self._anatomy, rows, level, draws))
        mujoco.mj_setConst(self.model, mujoco.MjData(self.model))  # it moves the robot that it gets

    def shove(self, force: Array) -> None:
        """Push the torso with a force [N], (3,), for a moment."""
        self._shove, self._shove_left = force, round(SHOVE_SECONDS / self.model.opt.timestep)

    def advance(self) -> None:
        """Simulate a step, unless the episode has ended."""
        self._previous = self._pose
        if self.has_ended:
            return
        if self.substep == 0:
            self._decide()
        self.data.xfrc_applied[self._anatomy.torso, :3] = self._force()
        mujoco.mj_step(self.model, self.data)
        self.substep = (self.substep + 1) % self.world.env.frame_skip
        if self.substep == 0:
            self._finish()
        self._pose = self._look_at()

    def step(self) -> None:
        """Simulate the present control step to its end."""
        self.advance()
        while self.substep:
            self.advance()

    def frame(self) -> Json:
        """Return what the page draws: poses before and after a step, and what is new for plots."""
        poses = {"previous": self._previous, "current": self._pose, "reports": self._reports}
        self._reports = []
        return poses | {"steps": self.num_steps, "total": self.total, "ended": self.has_ended}

    def _decide(self) -> None:
        """Choose torques, if it is time to, and send them to the motors."""
        if self.num_steps % self.policy.actions.hold == 0:
            chosen = self.policy.act(self._observation[None])[0]
            self._choice = np.asarray(chosen, dtype=np.float64)
        self._sent.append(self._choice)
        delay = int(self._levels.get("action_delay", 0))
        none_yet = np.zeros_like(self._choice)
        self._torques = self._sent[-1 - delay] if delay < len(self._sent) else none_yet
        self.data.ctrl[:] = self._torques * self._anatomy.control_limits
        self._push[:] = 0.0
        if "push" in self._levels and self.num_steps % round(PUSH_PERIOD / self._task.dt) == 0:
            towards = direction(self._draws["push"], self._anatomy)
            self._push[:2] = self._levels["push"] * towards

    def _force(self) -> Array:
        """Return the force on the torso [N], (3,)."""
        data, torso = self.data, self._anatomy.torso
        force = self._push.copy()
        if self._shove_left:
            force += self._shove
            self._shove_left -= 1
        if self.target is not None:
            away, speed = self.target - data.xpos[torso], np.zeros(3)
            if self._anatomy.is_free:
                first = self.model.body_dofadr[torso]
                speed = data.qvel[first : first + 3]
            force += self.model.body_mass.sum() * (PULL_RATE**2 * away - PULL_RATE * speed)
        return force

    def _finish(self) -> None:
        """Judge the control step that has ended."""
        self.num_steps += 1
        report, terminated = self._judge(self.data.xpos[self._anatomy.torso, 0] - self._x)
        self._reports.append(report)
        self.total += report["reward"]
        self.has_ended = terminated or self.num_steps >= self.world.env.max_episode_steps
        self._sense()

    def _judge(self, travel: float) -> tuple[Json, bool]:
        """Return what plots show of a control step, and whether it terminated the episode."""
        data, contacts = self.data, np.array([self.data.ncon], dtype=np.int32)
        qpos, qvel, torques = data.qpos[None], data.qvel[None], self._torques[None]
        outcome = self._task.judge(qpos, qvel, torques, np.array([travel]), contacts)
        report = {
            "time": self.num_steps * self._task.dt,
            "height": float(np.nan_to_num(self._anatomy.heights(qpos)[0])),
            "reward": float(outcome.rewards[0]),
            "terms": {name: float(own[0]) for name, own in outcome.terms.items()},
            "torques": self._torques.tolist(),
            "contacts": int(data.ncon),
        }
        return report, bool(outcome.terminated[0])

    def _sense(self) -> None:
        """Note where the torso is, and what the policy sees."""
        self._x = self.data.xpos[self._anatomy.torso, 0]
        self._seen.append(self._task.observe(self.data.qpos[None], self.data.qvel[None])[0])
        delay = int(self._levels.get("observation_delay", 0))
        self._observation = self._seen[max(0, len(self._seen) - 1 - delay)].copy()
        if "observation_noise" in self._levels:
            noise = np.full(len(self._observation), self._levels["observation_noise"])
            noise[self._anatomy.num_observed_positions :] *= VELOCITY_NOISE
            self._observation += noise * self._draws["observation_noise"].standard_normal(
                noise.size
            )

    def _look_at(self) -> Json:
        """Return where all parts are: their places and turns."""
        data = self.data
        parts = {"places": data.geom_xpos, "turns": data.geom_xmat}
        parts["torso"] = data.xpos[self._anatomy.torso]
        finite = {name: np.nan_to_num(own).ravel() for name, own in parts.items()}
        return {name: own.round(DIGITS).tolist() for name, own in finite.items()}


class _BatchOfOne:
    """A model as the batch whose numbers `PHYSICS` changes."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model

    def expand(self, name: str) -> NDArray[Any]:
        return attrgetter(name)(self._model)[None]
