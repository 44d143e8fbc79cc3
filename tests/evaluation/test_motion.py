"""Jumps and fluidity: values by hand, the authors' own example, and what must change nothing."""

import numpy as np
import pytest
from numpy.typing import NDArray

from jumping_ant.evaluation import evaluation
from jumping_ant.evaluation.motion import MIN_SPEED, apex, fluidity, phases, spectral_arc_length
from jumping_ant.params.model import Params
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.blind import UniformPolicy
from jumping_ant.sim import rollout
from jumping_ant.sim.world import World

DT = 0.05
Array = NDArray[np.float64]


class Swing:
    """Torques along a sine, opposite on the two pairs of legs."""

    actions = ActionSet()

    def start(self, seeds) -> None:
        self.num_steps = 0

    def act(self, observations: Array) -> NDArray[np.float32]:
        torque = 0.5 * np.sin(2 * np.pi * 2.0 * DT * self.num_steps)
        self.num_steps += 1
        return np.tile(np.float32(torque) * np.repeat([1, -1], 4), (len(observations), 1))


def swing(frequency: float = 2.0, seconds: float = 6.0) -> Array:
    """Angles of two joints that swing a quarter of a period apart, shape (T + 1, 2)."""
    times = DT * np.arange(round(seconds / DT) + 1)
    return np.stack([np.sin(2 * np.pi * frequency * times + phase) for phase in (0, np.pi / 2)], 1)


@pytest.mark.parametrize(
    ("airborne", "min_length", "expected"),
    [
        ("", 1, []),
        ("....", 1, []),
        ("####", 4, [[0, 4]]),
        ("####", 5, []),
        ("#..#", 1, [[0, 1], [3, 4]]),
        ("##.#.###", 2, [[0, 2], [5, 8]]),
        ("##.#.###", 2.5, [[5, 8]]),
        ("###", (0.1 + 0.05) / 0.05, [[0, 3]]),  # rounded, three steps and a little more
    ],
)
def test_phases_are_runs_that_are_long_enough(
    airborne: str, min_length: float, expected: list[list[int]]
) -> None:
    mask = np.array([sign == "#" for sign in airborne], dtype=np.bool_)
    assert phases(mask, min_length).tolist() == expected


def test_the_apex_is_a_mean_over_jumps() -> None:
    heights = np.array([9.0, 1.0, 3.0, 2.0, 5.0])
    assert apex(heights, np.array([[1, 3], [4, 5]])) == (3.0 + 5.0) / 2
    assert apex(heights, np.empty((0, 2), dtype=np.int64)) == 0.0


@pytest.mark.parametrize(
    ("signal", "dt", "length"),
    [
        # in the docstring of the authors' `sparc`
        (np.exp(-5 * np.arange(-1, 1, 0.01) ** 2), 0.01, -1.41403),
        (np.eye(40)[7], DT, -1.0),  # an impulse: a level line
    ],
)
def test_arc_lengths(signal: Array, dt: float, length: float) -> None:
    assert spectral_arc_length(signal, dt) == pytest.approx(length, abs=1e-5)


def test_jerks_make_a_movement_less_fluid() -> None:
    angles = swing()
    signs = np.random.default_rng(0).choice([-3.0, 3.0], (len(angles) - 1, 2))  # [ranges/s]
    jerks = np.concatenate([np.zeros((1, 2)), np.cumsum(DT * signs, axis=0)])
    assert fluidity(angles + jerks, DT) < fluidity(angles, DT) - 0.5 < 0


FOUR_SECONDS = swing(seconds=4.0)


@pytest.mark.parametrize(
    ("angles", "difference"),
    [
        (100 * FOUR_SECONDS, 1e-9),  # stronger
        (FOUR_SECONDS + 7.0, 1e-9),  # elsewhere
        *((swing(frequency), 0.1) for frequency in (1.5, 3.0, 4.0)),
        (np.concatenate([FOUR_SECONDS, np.repeat(FOUR_SECONDS[-1:], 80, axis=0)]), 1e-9),  # rests
        (np.concatenate([FOUR_SECONDS, np.ones((81, 1))], axis=1), 1e-9),  # beside a joint at rest
        (FOUR_SECONDS[:41], 0.01),  # a whole window is enough
    ],
)
def test_what_does_not_make_a_movement_fluid(angles: Array, difference: float) -> None:
    assert fluidity(angles, DT) == pytest.approx(fluidity(FOUR_SECONDS, DT), abs=difference)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "angles",
    [
        np.ones((200, 8)),  # at rest
        np.outer(np.arange(200) * DT, [0.9 * MIN_SPEED]),  # too slow
        swing(seconds=1.95),  # shorter than a window
        np.ones((1, 8)),  # no step at all
    ],
)
def test_without_a_window_that_moves_there_is_no_fluidity(angles: Array) -> None:
    assert np.isnan(fluidity(angles, DT))


def test_a_robot_that_swings_is_more_fluid_than_one_at_random(
    robot_xml: str, known_params: Params
) -> None:
    world = World(robot_xml, known_params.env.model_copy(update={"max_episode_steps": 200}))

    def measured(policy) -> float:
        (episode,) = rollout.run(world, policy, [3])
        return evaluation.measure(world, episode)["fluidity"]

    assert measured(UniformPolicy(0, ActionSet(), 8)) < measured(Swing())
