"""Perturbations: what each changes in the models, forces, starts, torques and observations.

What a level leaves open, such as which sensors are lost or where a push comes from, is drawn for
each start alone: every level and every policy meets the same.
`jumping_ant.sim.levels` has the units of the levels.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from jumping_ant.base.seeding import derive
from jumping_ant.sim.anatomy import Anatomy
from jumping_ant.sim.levels import LEVELS
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

NAMES = tuple(LEVELS)
# What passes between robot and policy; all others are of the world.
SENSING = ("observation_noise", "lost_sensors", "observation_delay", "action_delay")

VELOCITY_NOISE = 10.0  # [1/s] times that of positions: velocities reach 30 rad/s, angles 3 rad
PUSH_PERIOD = 1.0  # [s] from push to push; each lasts for a control step


class Condition(NamedTuple):
    """A perturbation, or none, and its level."""

    perturbation: str
    level: float


NONE = Condition("none", 0.0)


@dataclass(frozen=True)
class Perturbed:
    """Environments of a batch that are perturbed in the same way, each at its level."""

    envs: RobotVectorEnv
    rows: Rows
    levels: Array
    generators: Sequence[np.random.Generator]  # of each environment's choices

    @property
    def anatomy(self) -> Anatomy:
        """The robot's anatomy."""
        return self.envs.task.anatomy

    def model(self, field: str) -> Array:
        """Return a field of the models of the whole batch, which may be changed."""
        return self.envs.batch.expand(field)

    def each(self) -> Iterator[tuple[int, float, np.random.Generator]]:
        """Yield each environment's row, level and generator."""
        return zip(self.rows.tolist(), self.levels.tolist(), self.generators, strict=True)


def environments(
    world: World, conditions: Sequence[Condition], starts: Sequence[int], num_threads: int = 1
) -> RobotVectorEnv:
    """Return environments for an episode each, of these conditions and seeds of starts."""
    envs = RobotVectorEnv(world, len(starts), num_threads, AutoresetMode.DISABLED)
    for number, name in enumerate(NAMES):
        rows = [row for row, one in enumerate(conditions) if one.perturbation == name]
        if rows:
            seeds = [derive(starts[row], "perturbation", number) for row in rows]
            generators = [np.random.default_rng(seed) for seed in seeds]
            levels = np.array([conditions[row].level for row in rows])
            PERTURBATIONS[name](Perturbed(envs, np.array(rows), levels, generators))
    if any(condition != NONE for condition in conditions):
        envs.batch.set_const()
    return envs


@contextmanager
def silence() -> Iterator[None]:
    """Let numbers overflow, and MuJoCo warn in MUJOCO_LOG.TXT alone."""
    usual, quiet = mujoco.MjLogConfig.get(), mujoco.MjLogConfig.get()
    quiet.logto_console = False
    quiet.set()
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            yield
    finally:
        usual.set()


def torso_mass(group: Perturbed) -> None:
    """Set the torso's mass [kg], and scale its inertia with it."""
    masses, inertias = group.model("body_mass"), group.model("body_inertia")
    place = group.rows, group.anatomy.torso
    inertias[place] *= (group.levels / masses[place])[:, None]
    masses[place] = group.levels


def push(group: Perturbed) -> None:
    """Push the torso with a horizontal force [N] in the first control step of each period."""
    forces = group.envs.batch.bind("xfrc_applied")[:, group.anatomy.torso, :2]
    period, number = round(PUSH_PERIOD / group.envs.dt), 0  # [control steps]

    def begin_or_end(torques: Array) -> Array:
        nonlocal number
        forces[group.rows] = 0.0
        if number % period == 0:
            for row, strength, generator in group.each():
                forces[row] = strength * _direction(generator, group.anatomy)
        number += 1
        return torques

    group.envs.before_step.append(begin_or_end)


def friction(group: Perturbed) -> None:
    """Scale the sliding friction of all geoms."""
    group.model("geom_friction")[group.rows, :, 0] *= group.levels[:, None]


def gravity(group: Perturbed) -> None:
    """Scale gravity."""
    group.model("opt.gravity")[group.rows] *= group.levels[:, None]


def slope(group: Perturbed) -> None:
    """Incline gravity [degrees], which is as if the floor sloped."""
    vectors = group.model("opt.gravity")
    for row, level, generator in group.each():
        angle, strength = np.deg2rad(level), np.linalg.norm(vectors[row])
        across = np.sin(angle) * _direction(generator, group.anatomy)
        vectors[row] = strength * np.array([*across, -np.cos(angle)])


def damping(group: Perturbed) -> None:
    """Scale the damping of all joints."""
    group.model("dof_damping")[group.rows] *= group.levels[:, None]


def motor_strength(group: Perturbed) -> None:
    """Scale the torques of all motors."""
    group.model("actuator_gear")[group.rows] *= group.levels[:, None, None]


def observation_noise(group: Perturbed) -> None:
    """Add noise to observations."""
    factors = np.ones(group.anatomy.num_observations)
    factors[group.anatomy.num_observed_positions :] = VELOCITY_NOISE

    def noisy(observations: Array) -> Array:
        for row, level, generator in group.each():
            observations[row] += level * factors * generator.standard_normal(len(factors))
        return observations

    group.envs.on_observe.append(noisy)


def lost_sensors(group: Perturbed) -> None:
    """Let a share of the observed values read 0."""
    count = group.anatomy.num_observations
    lost = [(row, _chosen(share, count, generator)) for row, share, generator in group.each()]

    def without(observations: Array) -> Array:
        for row, places in lost:
            observations[row, places] = 0.0
        return observations

    group.envs.on_observe.append(without)


def observation_delay(group: Perturbed) -> None:
    """Show observations control steps late, and at first those of the start."""
    history = deque[Array](maxlen=int(group.levels.max()) + 1)
    group.envs.on_reset.append(history.clear)
    group.envs.on_observe.append(lambda observations: _late(group, history, observations))


def action_delay(group: Perturbed) -> None:
    """Let torques act control steps late, and none before the first."""
    delay = int(group.levels.max())
    history = deque(np.zeros((delay, len(group.rows), group.anatomy.num_motors)), delay + 1)
    group.envs.before_step.append(lambda torques: _late(group, history, torques.copy()))


def _direction(generator: np.random.Generator, anatomy: Anatomy) -> Array:
    """Return a horizontal unit vector, (2,); along x for a robot that moves in a plane."""
    angle = generator.uniform(0, 2 * np.pi)
    if not anatomy.is_free:
        angle = np.pi * (angle > np.pi)
    return np.array([np.cos(angle), np.sin(angle)])


def _chosen(share: float, count: int, generator: np.random.Generator) -> Rows:
    """Return a share of `count` indices, rounded, at least one; larger shares hold smaller ones."""
    return generator.permutation(count)[: max(1, round(share * count))]


PERTURBATIONS: dict[str, Callable[[Perturbed], None]] = {
    function.__name__: function
    for function in (
        *(torso_mass, push, friction, gravity, slope, damping, motor_strength),
        *(observation_noise, lost_sensors, observation_delay, action_delay),
    )
}


def _late(group: Perturbed, history: deque[Array], values: Array) -> Array:
    """Replace the values of perturbed environments by those `levels` steps before."""
    history.append(values[group.rows])
    last = len(history) - 1
    steps = last - np.minimum(group.levels.astype(np.int64), last)
    values[group.rows] = np.stack(history)[steps, np.arange(len(group.rows))]
    return values
