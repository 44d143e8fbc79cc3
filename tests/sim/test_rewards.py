"""The task by hand-computed numbers."""

import numpy as np
import pytest

from jumping_ant.params.models import RewardParams
from jumping_ant.sim.rewards import is_down, torso_height_reward

PARAMS = RewardParams(floor=0.6, span=0.5, scale=10.0)


@pytest.mark.parametrize(
    ("height", "reward"),
    [
        (0.0, 0.0),
        (0.6, 0.0),
        (0.7, 2.0),
        (0.85, 5.0),
        (1.1, 10.0),
        (7.0, 10.0),
        (np.nan, 0.0),
        (np.inf, 0.0),
        (-np.inf, 0.0),
    ],
)
def test_reward_rises_from_the_floor_over_the_span(height: float, reward: float) -> None:
    assert torso_height_reward(np.array([height]), PARAMS) == pytest.approx([reward])


def test_the_projects_reward_is_the_articles() -> None:
    article = RewardParams(floor=0.6, span=1.0, scale=10.0)
    heights = np.linspace(0, 3, 50)
    expected = 10 * np.clip(heights - 0.6, 0, 1)
    np.testing.assert_array_equal(torso_height_reward(heights, article), expected)


def test_an_episode_ends_below_the_height_and_not_at_it() -> None:
    qpos, qvel = np.zeros((3, 15)), np.zeros((3, 14))
    qpos[:, 2] = [0.2, np.nextafter(0.2, 0), 5.0]
    assert is_down(qpos, qvel, 0.2).tolist() == [False, True, False]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_an_episode_ends_where_a_state_is_not_finite(bad: float) -> None:
    qpos, qvel = np.ones((4, 15)), np.ones((4, 14))
    qpos[1, 0] = qpos[2, 14] = qvel[3, 13] = bad
    assert is_down(qpos, qvel, 0.2).tolist() == [False, True, True, True]
