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


def jerks(num_rows: int) -> Array:
    """Angles of two joints whose velocity jumps between -3 and 3 ranges a second, any time."""
    signs = np.random.default_rng(0).choice([-3.0, 3.0], (num_rows - 1, 2))
    return np.concatenate([np.zeros((1, 2)), np.cumsum(DT * signs, axis=0)])


@pytest.mark.parametrize(
    ("airborne", "min_length", "count"),
    [
        ("", 1, 0),
        ("....", 1, 0),
        ("####", 1, 1),
        ("####", 4, 1),
        ("####", 5, 0),
        ("#..#", 1, 2),
        ("##.#.###", 2, 2),
        ("##.#.###", 3, 1),
        ("##.#.###", 2.5, 1),
        (".#.#.#", 0, 3),
    ],
)
def test_phases_are_counted_by_their_length(airborne: str, min_length: float, count: int) -> None:
    mask = np.array([sign == "#" for sign in airborne], dtype=np.bool_)
    assert len(phases(mask, min_length)) == count


def test_minimal_times_are_not_lost_to_rounding() -> None:
    mask = np.ones(3, dtype=np.bool_)
    assert 0.15 / 0.05 < 3 < (0.1 + 0.05) / 0.05  # what division makes of three steps
    assert len(phases(mask, (0.1 + 0.05) / 0.05)) == 1


def test_phases_are_where_the_mask_is_true() -> None:
    mask = np.array([True, True, False, True, False, True, True, True])
    assert phases(mask, 2).tolist() == [[0, 2], [5, 8]]


def test_the_apex_is_a_mean_over_jumps() -> None:
    heights = np.array([9.0, 1.0, 3.0, 2.0, 5.0])
    assert apex(heights, np.array([[1, 3], [4, 5]])) == (3.0 + 5.0) / 2
    assert apex(heights, np.empty((0, 2), dtype=np.int64)) == 9.0


def test_the_arc_length_of_the_authors_example() -> None:
    times = np.arange(-1, 1, 0.01)  # in the docstring of their `sparc`
    assert spectral_arc_length(np.exp(-5 * times**2), 0.01) == pytest.approx(-1.41403, abs=1e-5)


def test_the_arc_length_of_an_impulse_is_that_of_a_level_line() -> None:
    assert spectral_arc_length(np.eye(40)[7], DT) == pytest.approx(-1.0)


def test_jerks_make_a_movement_less_fluid() -> None:
    angles = swing()
    steady, jerky = fluidity(angles, DT), fluidity(angles + jerks(len(angles)), DT)
    assert jerky < steady - 0.5 < 0


def test_neither_strength_nor_tempo_nor_offset_makes_a_movement_fluid() -> None:
    reference = fluidity(swing(), DT)
    assert fluidity(100 * swing(), DT) == pytest.approx(reference)
    assert fluidity(swing() + 7.0, DT) == pytest.approx(reference)
    for frequency in (1.5, 3.0, 4.0):
        assert fluidity(swing(frequency), DT) == pytest.approx(reference, abs=0.1)


def test_joints_and_times_at_rest_do_not_count() -> None:
    angles = swing(seconds=4.0)
    reference = fluidity(angles, DT)
    held = np.concatenate([angles, np.repeat(angles[-1:], 80, axis=0)])
    assert fluidity(held, DT) == pytest.approx(reference)
    with_still_joint = np.concatenate([angles, np.ones((len(angles), 1))], axis=1)
    assert fluidity(with_still_joint, DT) == pytest.approx(reference)


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


def test_a_whole_window_is_enough() -> None:
    assert np.isfinite(fluidity(swing(seconds=2.0), DT))


def test_a_robot_that_swings_is_more_fluid_than_one_at_random(
    robot_xml: str, known_params: Params
) -> None:
    world = World(robot_xml, known_params.env.model_copy(update={"max_episode_steps": 200}))

    def measured(policy) -> float:
        (episode,) = rollout.run(world, policy, [3])
        return evaluation.measure(world, episode)["fluidity"]

    assert measured(UniformPolicy(0, ActionSet(), 8)) < measured(Swing())
