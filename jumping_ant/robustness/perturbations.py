"""Perturbations of the physics: what each changes in the models of its simulations.

Each function changes the models of some simulations of a batch, `rows`, to one level each. The
other perturbations, of what policies observe and do, and of forces and starts, are in
`jumping_ant.robustness.perturbed`. `jumping_ant.params.blocks.PerturbationParams` has the units.

For the masses of the torso, the largest is that of RRLS, so that returns can be set beside those of
its robust Ant: Zouitine et al. 2024, "RRLS: Robust Reinforcement Learning Suite", arXiv 2406.08406.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from jumping_ant.base.seeding import derive
from jumping_ant.params.blocks import PerturbationParams
from jumping_ant.sim.anatomy import Anatomy

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
Generators = Sequence[np.random.Generator]

NAMES = tuple(PerturbationParams.model_fields)
# Those of what passes between robot and policy; all others are of the world.
SENSING = ("observation_noise", "lost_sensors", "observation_delay", "action_delay")


class Condition(NamedTuple):
    """A perturbation, or none, and its level."""

    perturbation: str
    level: float


NONE = Condition("none", 0.0)


@dataclass(frozen=True)
class Simulations:
    """Simulations of a batch that are perturbed in the same way, each at its level."""

    batch: Batch
    anatomy: Anatomy
    rows: Rows
    levels: Array
    generators: Generators  # of each simulation's own choices


def generator(condition: Condition, start: int) -> np.random.Generator:
    """Return the generator of an episode's choices: the same at every level, for every agent."""
    number = NAMES.index(condition.perturbation) if condition != NONE else len(NAMES)
    return np.random.default_rng(derive(start, "perturbation", number))


def direction(own: np.random.Generator, anatomy: Anatomy) -> Array:
    """Return a horizontal unit vector, (2,); along x for a robot that moves in a plane."""
    angle = own.uniform(0, 2 * np.pi)
    if not anatomy.is_free:
        angle = np.pi * (angle > np.pi)
    return np.array([np.cos(angle), np.sin(angle)])


def chosen(share: float, count: int, own: np.random.Generator) -> Rows:
    """Return a share of `count` indices, rounded, at least one; larger shares hold smaller ones."""
    return own.permutation(count)[: max(1, round(share * count))]


def torso_mass(own: Simulations) -> None:
    """Set the torso's mass [kg], and scale its inertia with it."""
    masses, inertias = own.batch.expand("body_mass"), own.batch.expand("body_inertia")
    place = own.rows, own.anatomy.torso
    inertias[place] *= (own.levels / masses[place])[:, None]
    masses[place] = own.levels


def friction(own: Simulations) -> None:
    """Scale the sliding friction of all geoms."""
    own.batch.expand("geom_friction")[own.rows, :, 0] *= own.levels[:, None]


def gravity(own: Simulations) -> None:
    """Scale gravity."""
    own.batch.expand("opt.gravity")[own.rows] *= own.levels[:, None]


def slope(own: Simulations) -> None:
    """Incline gravity [degrees], which is as if the floor sloped."""
    vectors, angles = own.batch.expand("opt.gravity"), np.deg2rad(own.levels)
    for row, angle, generator in zip(own.rows, angles, own.generators, strict=True):
        strength = np.linalg.norm(vectors[row])
        across = np.sin(angle) * direction(generator, own.anatomy)
        vectors[row] = strength * np.array([*across, -np.cos(angle)])


def damping(own: Simulations) -> None:
    """Scale the damping of all joints."""
    own.batch.expand("dof_damping")[own.rows] *= own.levels[:, None]


def motor_strength(own: Simulations) -> None:
    """Scale the torques of all motors."""
    own.batch.expand("actuator_gear")[own.rows] *= own.levels[:, None, None]


def dead_motors(own: Simulations) -> None:
    """Leave a share of the motors without torque."""
    gears = own.batch.expand("actuator_gear")
    for row, share, generator in zip(own.rows, own.levels, own.generators, strict=True):
        gears[row, chosen(share, own.anatomy.num_motors, generator)] = 0.0


def integration(own: Simulations) -> None:
    """Integrate with implicitfast; `PerturbedVectorEnv` takes as many steps as the level says."""
    own.batch.expand("opt.integrator")[own.rows] = int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)


PHYSICS: dict[str, Callable[[Simulations], None]] = {
    "torso_mass": torso_mass,
    "friction": friction,
    "gravity": gravity,
    "slope": slope,
    "damping": damping,
    "motor_strength": motor_strength,
    "dead_motors": dead_motors,
    "integration": integration,
}
