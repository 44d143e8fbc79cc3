"""The terms of the reward: what each of them measures in a control step.

A term is a function of the step and of its settings, the block of the same name in `env.reward`; it
adds its value times its weight. To add one, write its function here, its settings in
`jumping_ant.params.blocks.RewardParams`, and a test.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jumping_ant.params.blocks import RewardParams, TorsoHeightParams
from jumping_ant.sim.anatomy import Anatomy

Array = NDArray[np.float64]

PREFIX = "reward_"  # of term names in `info`, in tables and in recorded episodes


class ControlStep(NamedTuple):
    """A control step of n simulations, as the terms see it."""

    anatomy: Anatomy
    qpos: Array  # after the step, (n, num_positions)
    qvel: Array  # after the step, (n, num_velocities)
    heights: Array  # of the torsos after the step [m], (n,)
    velocities: Array  # of the torsos along x, means of the step [m/s], (n,)
    torques: Array  # over peak torques, held during the step, (n, num_motors)
    contacts: NDArray[np.int32]  # of each robot in the last simulation step, (n,)
    terminated: NDArray[np.bool_]  # whether the episode ends with the step, (n,)


def torso_height(step: ControlStep, settings: TorsoHeightParams) -> Array:
    """Return how high the torso is, from 0 at the floor of the term to 1 a span above it."""
    return np.minimum(np.maximum((step.heights - settings.floor) / settings.span, 0.0), 1.0)


def forward_velocity(step: ControlStep, _: Any) -> Array:
    """Return the mean velocity along x [m/s], as in the rewards of Gymnasium's robots."""
    return step.velocities


def alive(step: ControlStep, _: Any) -> Array:
    """Return 1 for episodes that do not end with the step, else 0."""
    return (~step.terminated).astype(np.float64)


def control_cost(step: ControlStep, _: Any) -> Array:
    """Return minus the sum of the squared torques over peak torques."""
    return -np.square(step.torques).sum(axis=1)


def upright(step: ControlStep, _: Any) -> Array:
    """Return the cosine of the torso's tilt."""
    return step.anatomy.uprightness(step.qpos)


TERMS: dict[str, Callable[[ControlStep, Any], Array]] = {
    function.__name__: function
    for function in (torso_height, forward_velocity, alive, control_cost, upright)
}


def active(params: RewardParams) -> dict[str, Any]:
    """Return the settings of the terms that count, in the order in which they are summed."""
    settings = {name: getattr(params, name) for name in TERMS}
    return {name: term for name, term in settings.items() if term is not None and term.weight}


def terms(step: ControlStep, settings: Mapping[str, Any]) -> dict[str, Array]:
    """Return the weighted values of the terms with these settings, shape (n,) each, by name."""
    return {name: term.weight * TERMS[name](step, term) for name, term in settings.items()}
