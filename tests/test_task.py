"""What the single and the batched environment have in common."""

import numpy as np
import pytest

from jumping_ant import robot
from jumping_ant.task import COMMANDS, observe, start_state


def test_the_five_commands_are_the_articles() -> None:
    assert COMMANDS.tolist() == [
        [0, 0, 0, 0, 0, 0, 0, 0],
        [0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5],
        [-0.5, -0.5, -0.5, -0.5, -0.5, -0.5, -0.5, -0.5],
        [0.5, 0.5, 0.5, 0.5, -0.5, -0.5, -0.5, -0.5],
        [-0.5, -0.5, -0.5, -0.5, 0.5, 0.5, 0.5, 0.5],
    ]
    with pytest.raises(ValueError, match="read-only"):
        COMMANDS[0] = 1.0


def test_observe_shows_zero_for_what_is_not_finite() -> None:
    qpos, qvel = np.arange(15.0)[None], np.full((1, 14), 7.0)
    qvel[0, 3] = np.inf
    expected = [*range(2, 15), *[7.0] * 14]
    expected[13 + 3] = 0.0
    assert observe(qpos, qvel).tolist() == [expected]


def test_observe_hides_where_the_robot_is_and_copies() -> None:
    qpos, qvel = np.arange(30.0).reshape(2, 15), np.arange(28.0).reshape(2, 14)
    observations = observe(qpos, qvel)
    assert observations[1].tolist() == [*range(17, 30), *range(14, 28)]
    assert not np.shares_memory(observations, qpos)


def test_start_states_are_as_noisy_as_told(robot_xml: str) -> None:
    model, generator = robot.load(robot_xml), np.random.default_rng(0)
    states = [start_state(model, 0.2, generator) for _ in range(2000)]
    offsets = np.array([qpos for qpos, _ in states]) - model.qpos0
    speeds = np.array([qvel for _, qvel in states])
    assert 0.19 < np.abs(offsets).max() < 0.2
    np.testing.assert_allclose(offsets.std(axis=0), 0.2 / np.sqrt(3), rtol=0.1)
    np.testing.assert_allclose(speeds.std(axis=0), 0.2, rtol=0.1)
