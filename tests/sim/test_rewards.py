"""The terms of the reward and the ends of episodes, by hand-computed numbers."""

from typing import Any

import numpy as np
import pytest

from jumping_ant.params import article
from jumping_ant.params.blocks import EnvParams, RewardParams
from jumping_ant.sim import rewards
from jumping_ant.sim.task import Outcome, Task
from jumping_ant.sim.world import World

OFF: dict[str, Any] = {name: {"weight": 0.0} for name in rewards.TERMS}
OFF["torso_height"] |= {"floor": 0.6, "span": 0.5}


def reward(**weights: float) -> RewardParams:
    given = {name: OFF[name] | {"weight": weight} for name, weight in weights.items()}
    return RewardParams.model_validate(OFF | given)


def task(robot_xml: str, **changes: Any) -> Task:
    params = article.ENV.model_copy(update={"min_torso_height": None} | changes)
    return Task(World(robot_xml, EnvParams.model_validate(params.model_dump())))


def judge(
    task: Task, qpos: np.ndarray, torques: np.ndarray | None = None, travel: float = 0.0
) -> Outcome:
    count = len(qpos)
    torques = np.zeros((count, 8)) if torques is None else torques
    on_ground = np.ones(count, dtype=np.int32)
    return task.judge(qpos, np.zeros((count, 14)), torques, np.full(count, travel), on_ground)


def poses(*heights: float) -> np.ndarray:
    qpos = np.zeros((len(heights), 15))
    qpos[:, 2], qpos[:, 3] = heights, 1.0
    return qpos


def test_every_term_has_settings_and_every_setting_a_term() -> None:
    assert list(rewards.TERMS) == list(RewardParams.model_fields)


@pytest.mark.parametrize(
    ("height", "value"),
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
def test_height_earns_from_the_floor_over_the_span(
    robot_xml: str, height: float, value: float
) -> None:
    jump = task(robot_xml, reward=reward(torso_height=10.0))
    assert judge(jump, poses(height)).rewards == pytest.approx([value])


@pytest.mark.parametrize("travel", [0.1, -0.1])
def test_velocity_is_the_way_along_x_over_the_time(robot_xml: str, travel: float) -> None:
    run = task(robot_xml, reward=reward(forward_velocity=2.0))
    assert judge(run, poses(1.0), travel=travel).rewards == pytest.approx([2 * travel / 0.05])


def test_being_alive_pays_until_the_end(robot_xml: str) -> None:
    stay = task(robot_xml, reward=reward(alive=1.5), min_torso_height=0.5)
    assert judge(stay, poses(0.6, 0.4)).rewards.tolist() == [1.5, 0.0]


def test_torques_cost_their_squares(robot_xml: str) -> None:
    save = task(robot_xml, reward=reward(control_cost=0.5))
    torques = np.array([[1, -1, 0.5, 0, 0, 0, 0, 0], [0] * 8])
    assert judge(save, poses(1.0, 1.0), torques).rewards.tolist() == [-0.5 * 2.25, 0.0]


def test_leaning_earns_less(robot_xml: str) -> None:
    stand = task(robot_xml, reward=reward(upright=3.0))
    qpos = poses(1.0, 1.0, 1.0, 1.0)
    half = np.sqrt(0.5)
    qpos[:, 3:7] = [[1, 0, 0, 0], [half, half, 0, 0], [0, 0, 1, 0], [half, 0, 0, half]]
    np.testing.assert_allclose(judge(stand, qpos).rewards, [3, 0, -3, 3], atol=1e-12)


def test_the_reward_is_the_sum_of_the_terms_that_count(robot_xml: str) -> None:
    both = task(robot_xml, reward=reward(torso_height=10.0, alive=1.0, upright=0.25))
    outcome = judge(both, poses(0.7, 0.0))
    assert list(outcome.terms) == ["torso_height", "alive", "upright"]
    np.testing.assert_array_equal(outcome.rewards, sum(outcome.terms.values()))
    assert outcome.rewards == pytest.approx([2 + 1 + 0.25, 1 + 0.25])
    nothing = judge(task(robot_xml, reward=reward()), poses(1.0))
    assert (nothing.rewards.tolist(), nothing.terms) == ([0.0], {})


@pytest.mark.parametrize(
    ("limit", "inside", "outside"),
    [
        ({"min_torso_height": 0.2}, (0.2, 5.0), np.nextafter(0.2, 0)),
        ({"max_torso_height": 1.0}, (1.0, -5.0), np.nextafter(1.0, 2)),
    ],
)
def test_an_episode_ends_beyond_a_height_and_not_at_it(
    robot_xml: str, limit: dict[str, float], inside: tuple[float, float], outside: float
) -> None:
    outcome = judge(task(robot_xml, **limit), poses(*inside, outside))
    assert outcome.terminated.tolist() == [False, False, True]


def test_an_episode_ends_where_the_torso_leans_too_far(robot_xml: str) -> None:
    steep, qpos = task(robot_xml, max_tilt=0.5), poses(1.0, 1.0, 1.0)
    for row, angle in enumerate((0.49, 0.51, np.pi)):
        qpos[row, 3:7] = np.cos(angle / 2), 0, np.sin(angle / 2), 0
    assert judge(steep, qpos).terminated.tolist() == [False, True, True]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_an_episode_ends_where_a_state_is_not_finite_and_earns_nothing(
    robot_xml: str, bad: float
) -> None:
    every = task(robot_xml, reward=reward(**dict.fromkeys(rewards.TERMS, 1.0)))
    qpos, qvel = poses(1.0, 1.0, 1.0, 1.0), np.ones((4, 14))
    qpos[1, 0] = qpos[2, 14] = qvel[3, 13] = bad
    outcome = every.judge(qpos, qvel, np.ones((4, 8)), np.ones(4), np.ones(4, np.int32))
    assert outcome.terminated.tolist() == [False, True, True, True]
    assert (outcome.rewards != 0).tolist() == [True, False, False, False]
