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
    weighted = {name: OFF[name] | {"weight": weight} for name, weight in weights.items()}
    return RewardParams.model_validate(OFF | weighted)


def task(robot_xml: str, **changes: Any) -> Task:
    params = article.ENV.model_copy(update={"min_torso_height": None} | changes)
    return Task(World(robot_xml, EnvParams.model_validate(params.model_dump())))


def judge(task: Task, qpos: np.ndarray, torques: Any = ((0.0,) * 8,), travel: float = 0) -> Outcome:
    count = len(qpos)
    velocities, on_ground = np.zeros((count, 14)), np.ones(count, dtype=np.int32)
    return task.judge(qpos, velocities, np.array(torques), np.full(count, travel), on_ground)


def poses(*heights: float, quaternion: tuple[float, ...] = (1, 0, 0, 0)) -> np.ndarray:
    qpos = np.zeros((len(heights), 15))
    qpos[:, 2], qpos[:, 3:7] = heights, quaternion
    return qpos


HALF = np.sqrt(0.5)
NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("weights", "qpos", "moved", "values"),
    [
        ({"torso_height": 10.0}, poses(0.0, 0.6, 0.7, 0.85, 1.1, 7.0), {}, [0, 0, 2, 5, 10, 10]),
        ({"torso_height": 10.0}, poses(NAN, INF, -INF), {}, [0, 0, 0]),
        ({"forward_velocity": 2.0}, poses(1.0), {"travel": 0.1}, [4.0]),
        ({"forward_velocity": 2.0}, poses(1.0), {"travel": -0.1}, [-4.0]),
        ({"alive": 1.5}, poses(0.6, 0.4), {}, [1.5, 0.0]),
        ({"control_cost": 0.5}, poses(1.0), {"torques": [[1, -1, 0.5, *[0] * 5]]}, [-0.5 * 2.25]),
        ({"upright": 3.0}, poses(1.0, 1.0), {}, [3.0, 3.0]),
        ({"upright": 3.0}, poses(1.0, quaternion=(HALF, HALF, 0, 0)), {}, [0.0]),
        ({"upright": 3.0}, poses(1.0, quaternion=(0, 0, 1, 0)), {}, [-3.0]),
        ({"upright": 3.0}, poses(1.0, quaternion=(HALF, 0, 0, HALF)), {}, [3.0]),
    ],
)
def test_each_term_is_its_measure_times_its_weight(
    robot_xml: str, weights: dict[str, float], qpos: np.ndarray, moved: Any, values: list[float]
) -> None:
    outcome = judge(task(robot_xml, reward=reward(**weights), min_torso_height=0.5), qpos, **moved)
    assert outcome.rewards == pytest.approx(values, abs=1e-12)


def test_the_reward_is_the_sum_of_the_terms_that_count(robot_xml: str) -> None:
    both = task(robot_xml, reward=reward(torso_height=10.0, alive=1.0, upright=0.25))
    outcome = judge(both, poses(0.7, 0.0))
    assert list(outcome.terms) == ["torso_height", "alive", "upright"]
    np.testing.assert_array_equal(outcome.rewards, sum(outcome.terms.values()))
    assert outcome.rewards == pytest.approx([2 + 1 + 0.25, 1 + 0.25])
    nothing = judge(task(robot_xml, reward=reward()), poses(1.0))
    assert (nothing.rewards.tolist(), nothing.terms) == ([0.0], {})


def leaning(angle: float) -> np.ndarray:
    return poses(1.0, quaternion=(np.cos(angle / 2), 0, np.sin(angle / 2), 0))


@pytest.mark.parametrize(
    ("limit", "inside", "outside"),
    [
        ({"min_torso_height": 0.2}, poses(0.2, 5.0), poses(np.nextafter(0.2, 0))),
        ({"max_torso_height": 1.0}, poses(1.0, -5.0), poses(np.nextafter(1.0, 2))),
        ({"max_tilt": 0.5}, leaning(0.49), leaning(0.51)),
        ({"max_tilt": 0.5}, leaning(-0.49), leaning(np.pi)),
    ],
)
def test_an_episode_ends_beyond_a_limit_and_not_at_it(
    robot_xml: str, limit: dict[str, float], inside: np.ndarray, outside: np.ndarray
) -> None:
    limited = task(robot_xml, **limit)
    assert not judge(limited, inside).terminated.any()
    assert judge(limited, outside).terminated.all()


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
