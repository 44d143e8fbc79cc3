"""The single environment, against Gymnasium's Ant-v5 and by its own rules."""

import copy
import pickle
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from commands import COMMAND_SIGNS
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

from jumping_ant.base.errors import InputError
from jumping_ant.params import article, presets
from jumping_ant.params.blocks import EnvParams
from jumping_ant.params.model import Params
from jumping_ant.policies.actions import ActionSet
from jumping_ant.sim import robot
from jumping_ant.sim.env import RobotEnv, article_world
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World


@pytest.fixture
def env(robot_xml: str, known_params: Params) -> RobotEnv:
    return RobotEnv(World(robot_xml, known_params.env))


def task(params: Params, **changes: Any) -> EnvParams:
    return params.env.model_copy(update=changes)


def torques(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (count, 8)).astype(np.float32)


def test_gymnasiums_own_checks_pass(env: RobotEnv) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for harmless in ("space minimum", "space maximum", "not having a spec"):
            warnings.filterwarnings("ignore", f".*{harmless}.*")
        check_env(env)


# Gymnasium's names of the terms that it pays.
GYMNASIUM_TERMS = {
    "reward_forward": "reward_forward_velocity",
    "reward_survive": "reward_alive",
    "reward_ctrl": "reward_control_cost",
}


def test_presets_run_is_ant_v5_to_the_last_bit() -> None:
    """Its reward and the terms of that included; contact forces cost nothing there."""
    params, limit = presets.load("run"), {"max_episode_steps": 10**9}
    ours = RobotEnv(World(robot.build(params.robot), task(params, **limit)))
    without: dict[str, Any] = {"include_cfrc_ext_in_observation": False, "contact_cost_weight": 0.0}
    theirs: Any = gym.make("Ant-v5", **without, **limit)
    ends = 0
    for step, action in enumerate(torques(1000).astype(np.float64)):
        if step % 300 == 0:
            np.testing.assert_array_equal(ours.reset(seed=step)[0], theirs.reset(seed=step)[0])
        observation, reward, terminated, truncated, info = ours.step(action)
        reference, paid, over, _, its_info = theirs.step(action)
        np.testing.assert_array_equal(observation, reference)
        assert (reward, terminated, truncated) == (paid, over, False)
        for its_name, name in GYMNASIUM_TERMS.items():
            assert info[name] == its_info[its_name]
        ends += terminated
        if terminated or step % 70 == 69:
            np.testing.assert_array_equal(ours.reset()[0], theirs.reset()[0])
    assert ends > 0
    theirs.close()


def test_termination_is_ant_v5s(source_xml: str, known_params: Params) -> None:
    """In a fall: the torso sinks through a limit on the way."""
    ours = RobotEnv(World(source_xml, task(known_params, min_torso_height=0.7)))
    theirs: Any = gym.make("Ant-v5", healthy_z_range=(0.7, np.inf))
    ends = []
    for env in (ours, theirs.unwrapped):
        for seed in range(4):
            env.reset(seed=seed)
            ends.append([env.step(np.zeros(8))[2] for _ in range(20)].index(True))
    assert ends[:4] == ends[4:] and max(ends) > 0
    theirs.close()


def test_reward_is_the_sum_of_its_terms_and_follows_the_height(env: RobotEnv) -> None:
    env.reset(seed=0)
    for action in torques(100):
        observation, reward, _, _, info = env.step(action)
        terms = [value for key, value in info.items() if key.startswith("reward_")]
        assert reward == sum(terms)
        assert info["torso_height"] == observation[0] == env.envs.qpos[0, 2]
        assert reward == pytest.approx(10 * np.clip(observation[0] - 0.6, 0, 1))


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_alike(env: RobotEnv, copied: Callable[[RobotEnv], RobotEnv]) -> None:
    actions = np.random.default_rng(0).uniform(-1, 1, (40, *env.action_space.shape))
    env.reset(seed=0)
    for action in actions[:20]:
        env.step(action)
    envs = [env, copied(env)]
    for action in actions[20:]:
        (ours, *_), (theirs, *_) = (each.step(action) for each in envs)
        np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(*(each.reset()[0] for each in envs))


@pytest.mark.parametrize(("low", "ends"), [(0.0, (False, True)), (5.0, (True, False))])
def test_an_episode_is_cut_at_the_limit_where_a_fall_is_a_fall(
    robot_xml: str, known_params: Params, low: float, ends: tuple[bool, bool]
) -> None:
    env = RobotEnv(World(robot_xml, task(known_params, max_episode_steps=3, min_torso_height=low)))
    for _ in range(2):
        env.reset(seed=0)
        outcomes = [env.step(np.zeros(8))[2:4] for _ in range(3)]
        assert outcomes == [(low > 0, False), (low > 0, False), ends]


def test_make_and_make_vec_give_the_articles_robot_and_task() -> None:
    same = RobotEnv(World(robot.build(article.ROBOT), article.ENV))
    made, batch = gym.make("JumpingAnt-v0"), gym.make_vec("JumpingAnt-v0", num_envs=2)
    assert isinstance(batch, RobotVectorEnv)
    start = same.reset(seed=3)[0]
    np.testing.assert_array_equal(made.reset(seed=3)[0], start)
    np.testing.assert_array_equal(batch.reset(seed=2)[0][1], start)
    for action in torques(30):
        expected, step = same.step(action), made.step(action)
        np.testing.assert_array_equal(step[0], expected[0])
        assert step[1:] == expected[1:]
        for part, values in enumerate(batch.step(np.stack([action, action]))[:4]):
            np.testing.assert_array_equal(values[1], expected[part])
    for env in (made, batch):
        env.close()


def test_the_pinned_task_has_the_articles_numbers() -> None:
    """Ant-v4's control step and noise; 0 to 10 for heights from 0.6 to 1.6 m; over below 0.2 m."""
    env = RobotEnv(article_world())
    assert env.envs.dt == 0.05 and env.world.env.frame_skip == 5
    assert env.observation_space.shape == (27,) and env.action_space.shape == (8,)
    rewards = {0.19: 0.0, 0.21: 0.0, 0.6: 0.0, 1.1: 5.0, 1.6: 10.0, 5.0: 10.0}
    for height, reward in rewards.items():
        env.reset(seed=0)
        env.envs.batch.expand("opt.timestep")[:] = 1e-9  # it stays where it is put
        env.envs.qpos[0, 2] = height
        outcome = env.step(np.zeros(8))
        assert outcome[1] == pytest.approx(reward, abs=1e-5) and outcome[2] == (height < 0.2)
    starts = np.array([env.reset()[0] for _ in range(500)])
    offsets = starts[:, :13] - env.world.model.qpos0[2:]
    assert 0.099 < np.abs(offsets).max() < 0.1
    np.testing.assert_allclose(starts[:, 13:].std(axis=0), 0.1, rtol=0.15)


def test_a_limit_of_steps_is_gymnasiums() -> None:
    """As `TimeLimit` counts them, in decisions; some wrappers take it from the specification."""
    made = gym.make("JumpingAnt-v0")
    limit = made.spec.max_episode_steps  # type: ignore[union-attr]
    assert limit == article.ENV.max_episode_steps
    assert gym.wrappers.TimeAwareObservation(made).reset(seed=0)[0].shape == (28,)
    for hold in (1, 3):
        options: Any = {"num_envs": 2, "max_episode_steps": 7, "actions": ActionSet(hold=hold)}
        for mode in ("sync", "vector_entry_point"):
            envs = gym.make_vec("JumpingAnt-v0", vectorization_mode=mode, **options)
            envs.reset(seed=0)
            ends = [envs.step(np.zeros((2, 8)))[3].tolist() for _ in range(7)]
            assert ends == [[False, False]] * 6 + [[True, True]]


def test_an_agents_environment_is_what_its_policy_loads_with() -> None:
    """float32, made again from its specification, and shown as long as it lasts."""
    actions = ActionSet(0.5 * COMMAND_SIGNS, hold=3)
    first = gym.make("JumpingAnt-v0", actions=actions, render_mode="rgb_array")
    assert first.metadata["render_fps"] == pytest.approx(20 / 3)
    again = gym.make(first.spec)
    for env in (first, again):
        assert env.observation_space.dtype == np.float32 == env.reset(seed=0)[0].dtype
    assert gym.make("JumpingAnt-v0").observation_space.dtype == np.float64
    np.testing.assert_array_equal(first.step(2)[0], again.step(2)[0])


@pytest.mark.parametrize(
    ("actions", "wrong", "fault"),
    [
        (ActionSet(), 0.5, r"actions: given shape \(1,\), allowed: \(1, 8\)"),
        (ActionSet(), np.zeros(1), "given shape"),
        (ActionSet(), np.zeros((1, 8)), "given shape"),
        (ActionSet(0.5 * COMMAND_SIGNS), np.zeros(8, int), "given shape"),
        (ActionSet(0.5 * COMMAND_SIGNS), -1, r"actions: given \[-1\], allowed: 0 to 4"),
        (ActionSet(0.5 * COMMAND_SIGNS), 5, "allowed: 0 to 4"),
        (ActionSet(0.5 * COMMAND_SIGNS), 1.0, "allowed: 0 to 4"),
        (ActionSet(levels=2), np.full(8, 2), "allowed: 0 to 1"),
    ],
)
def test_an_action_that_is_none_is_refused(
    robot_xml: str, known_params: Params, actions: ActionSet, wrong: Any, fault: str
) -> None:
    env = RobotEnv(World(robot_xml, known_params.env), actions=actions)
    with pytest.raises(ResetNeeded):
        env.step(env.action_space.sample())
    env.reset(seed=0)
    before = env.envs.qpos.copy()
    with pytest.raises(InputError, match=fault):
        env.step(wrong)
    assert np.array_equal(env.envs.qpos, before)


def test_pictures_are_shown_as_fast_as_the_robot_moves(
    robot_xml: str, known_params: Params
) -> None:
    env = RobotEnv(World(robot_xml, task(known_params, frame_skip=4)))
    assert env.metadata["render_fps"] == 25
