"""Environments that are perturbed, each in its own way."""

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from mujoco.batch import SimulationError
from numpy.typing import NDArray

from jumping_ant.robustness.perturbations import (
    PHYSICS,
    Array,
    Condition,
    Rows,
    Simulations,
    chosen,
    direction,
    generator,
)
from jumping_ant.sim.vector import Mask, RobotVectorEnv
from jumping_ant.sim.world import World

VELOCITY_NOISE = 10.0  # [1/s] times that of positions: velocities reach 30 rad/s, angles 3 rad
PUSH_PERIOD = 1.0  # [s] from push to push; each lasts for a control step


class PerturbedVectorEnv(RobotVectorEnv):
    """A batch of environments for one episode each, under one condition each.

    What a condition leaves open, such as which motors are dead or where a push comes from, is drawn
    for each start alone: every level and every policy meets the same.

    Args:
        world: The robot and the task.
        plays: Condition and seed of the start of each episode.
        num_threads: Threads that step them; results do not depend on it.
    """

    def __init__(
        self, world: World, plays: Sequence[tuple[Condition, int]], num_threads: int = 1
    ) -> None:
        super().__init__(world, len(plays), num_threads, AutoresetMode.DISABLED)
        self._plays = plays
        self._own = [generator(condition, start) for condition, start in plays]
        self._levels = np.array([condition.level for condition, _ in plays])
        self._names = np.array([condition.perturbation for condition, _ in plays])
        for name, perturb in PHYSICS.items():
            rows = self._rows(name)
            if len(rows):
                own = [self._own[row] for row in rows]
                anatomy = self.task.anatomy
                perturb(Simulations(self.batch, anatomy, rows, self._levels[rows], own))
        self._num_substeps = self._substeps()
        self.batch.set_const()
        self._lost = self._lost_sensors()
        self._noise = self._observation_noise()
        self._observation_delay = self._delay("observation_delay")
        self._action_delay = self._delay("action_delay")
        self._seen: deque[Array] = deque(maxlen=int(self._observation_delay.max()) + 1)
        self._sent: deque[Array] = deque(maxlen=int(self._action_delay.max()) + 1)
        self._number = 0  # of control steps
        self._is_running = np.ones(self.num_envs, dtype=np.bool_)
        self._forces = self.batch.bind("xfrc_applied")[:, self.task.anatomy.torso, :2]
        self._pushed = self._rows("push")

    def begin(self) -> Array:
        """Start all episodes; return the first observations, (num_envs, num_observations)."""
        observations, _ = self.reset(seed=[start for _, start in self._plays])
        # Before the first torques arrive, there are none.
        delay, motors = self._sent.maxlen or 0, self.task.anatomy.num_motors
        self._sent.extend(np.zeros((delay, self.num_envs, motors)))
        return self._sensed(observations)

    def step(self, actions: NDArray[Any]) -> tuple[Array, Array, Mask, Mask, dict[str, Any]]:
        """Simulate a control step of all environments, as `RobotVectorEnv.step` does."""
        self._sent.append(np.asarray(actions, dtype=np.float64))
        self._push()
        observations, rewards, terminated, truncated, infos = super().step(
            _as_of(self._sent, self._action_delay)
        )
        self._number += 1
        self._is_running &= ~(terminated | truncated)
        return self._sensed(observations), rewards, terminated, truncated, infos

    def _rows(self, name: str) -> Rows:
        """Return the environments under a perturbation."""
        return np.flatnonzero(self._names == name)

    def _delay(self, name: str) -> Rows:
        return np.where(self._names == name, self._levels, 0).astype(np.int64)

    def _substeps(self) -> Rows:
        """Return how many simulation steps each environment takes in a control step."""
        substeps = np.full(self.num_envs, self.world.env.frame_skip)
        rows = self._rows("integration")
        if len(rows):
            substeps[rows] = self._levels[rows].astype(np.int64)
            self.batch.expand("opt.timestep")[rows] = self.dt / substeps[rows]
        return substeps

    def _simulate(self, running: NDArray[np.int64] | None) -> None:
        """Advance the episodes that have not ended: what has fallen apart would not stop to."""
        broken = []
        for count in np.unique(self._num_substeps):
            rows = np.flatnonzero((self._num_substeps == count) & self._is_running)
            try:
                self.batch.step(rows, nstep=int(count))
            except SimulationError as error:  # the others take their steps, too
                broken.append(error)
        if broken:
            raise SimulationError(np.concatenate([error.ids for error in broken]), str(broken[0]))

    def _start_episodes(self, indices: NDArray[np.int64]) -> None:
        super()._start_episodes(indices)
        rows = np.intersect1d(indices, self._rows("tilt"))
        if len(rows):
            for row in rows:
                self._tilt(row)
            self.batch.forward(rows)
            self._last_x[rows] = self._torso_x[rows]

    def _tilt(self, row: int) -> None:
        """Turn a robot about a horizontal axis, as high as tumbled starts are."""
        anatomy, angle = self.task.anatomy, np.deg2rad(self._levels[row])
        axis, turned = direction(self._own[row], anatomy), self.qpos[row, anatomy.orientation]
        if anatomy.is_free:
            turned[:] = _product([np.cos(angle / 2), *(np.sin(angle / 2) * axis), 0.0], turned)
        else:
            turned += angle * axis[0]
        height = self.world.env.drop_height - anatomy.height_offset
        self.qpos[row, anatomy.height_address] = height

    def _lost_sensors(self) -> Mask:
        """Return which observed values read 0, (num_envs, num_observations)."""
        lost = np.zeros((self.num_envs, self.task.anatomy.num_observations), dtype=np.bool_)
        for row in self._rows("lost_sensors"):
            lost[row, chosen(self._levels[row], lost.shape[1], self._own[row])] = True
        return lost

    def _observation_noise(self) -> Array:
        """Return the standard deviation of each observed value, (num_envs, num_observations)."""
        noise = np.zeros((self.num_envs, self.task.anatomy.num_observations))
        rows = self._rows("observation_noise")
        noise[rows] = self._levels[rows, None]
        noise[:, self.task.anatomy.num_observed_positions :] *= VELOCITY_NOISE
        return noise

    def _sensed(self, observations: Array) -> Array:
        """Return what policies get to see of the observations."""
        self._seen.append(observations)
        sensed = _as_of(self._seen, self._observation_delay)
        for row in self._rows("observation_noise"):
            sensed[row] += self._noise[row] * self._own[row].standard_normal(sensed.shape[1])
        sensed[self._lost] = 0.0
        return sensed

    def _push(self) -> None:
        """Begin a push, or end the last one."""
        if not len(self._pushed):
            return
        self._forces[self._pushed] = 0.0
        if self._number % round(PUSH_PERIOD / self.dt) == 0:
            for row in self._pushed:
                push = self._levels[row] * direction(self._own[row], self.task.anatomy)
                self._forces[row] = push


def _as_of(history: Sequence[Array], delays: Rows) -> Array:
    """Return each row of the last of several arrays, or as it was `delays` arrays before."""
    latest = history[-1]
    if not delays.any():
        return latest.copy()
    ages = np.minimum(delays, len(history) - 1)
    return np.stack(history)[len(history) - 1 - ages, np.arange(len(latest))]


def _product(first: Sequence[float], second: Array) -> Array:
    """Return the product of two quaternions (w, x, y, z)."""
    w, x, y, z = first
    matrix = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    return matrix @ second
