"""The single environment, against Gymnasium's Ant-v5 and by its own rules."""

import os
import subprocess
import sys
import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from jumping_ant import params_file, robot
from jumping_ant.env import DiscreteCommands, JumpingAnt
from jumping_ant.errors import InputError
from jumping_ant.files import PROJECT_ROOT
from jumping_ant.params import EnvParams, Params
from jumping_ant.task import COMMANDS

DRAW = """
import gymnasium, jumping_ant.env

env = gymnasium.make("JumpingAnt-v0", render_mode="rgb_array")
env.reset(seed=0)
picture = env.render()
assert picture.shape == (480, 480, 3), picture.shape
assert picture.dtype == "uint8"
assert picture.max() > 0 and picture.std() > 1
env.close()
"""


@pytest.fixture
def env(robot_xml: str, known_params: Params) -> JumpingAnt:
    return JumpingAnt(robot_xml, known_params.env)


def task(params: Params, **changes: Any) -> EnvParams:
    return params.env.model_copy(update=changes)


def torques(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (count, 8)).astype(np.float32)


def test_gymnasiums_own_checks_pass(env: JumpingAnt) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for harmless in ("space minimum", "space maximum", "not having a spec"):
            warnings.filterwarnings("ignore", f".*{harmless}.*")
        check_env(env)


def test_it_is_ant_v5_to_the_last_bit(source_xml: str, known_params: Params) -> None:
    ours = JumpingAnt(source_xml, task(known_params, max_episode_steps=10**9))
    theirs: Any = gym.make(
        "Ant-v5",
        include_cfrc_ext_in_observation=False,
        healthy_z_range=(known_params.env.min_torso_height, np.inf),
        max_episode_steps=10**9,
    )
    for step, action in enumerate(torques(1000)):
        if step % 300 == 0:
            np.testing.assert_array_equal(ours.reset(seed=step)[0], theirs.reset(seed=step)[0])
        observation, _, terminated, truncated, _ = ours.step(action)
        reference, _, over, _, _ = theirs.step(action)
        np.testing.assert_array_equal(observation, reference)
        assert (terminated, truncated) == (bool(over), False)
        if terminated or step % 70 == 69:
            np.testing.assert_array_equal(ours.reset()[0], theirs.reset()[0])
    theirs.close()


def test_termination_is_ant_v5s(source_xml: str, known_params: Params) -> None:
    """In a fall: the torso sinks through a limit on the way."""
    ours = JumpingAnt(source_xml, task(known_params, min_torso_height=0.7))
    theirs: Any = gym.make("Ant-v5", healthy_z_range=(0.7, np.inf))
    ended = []
    for seed in range(4):
        ours.reset(seed=seed)
        theirs.reset(seed=seed)
        for step in range(20):
            mine, other = ours.step(np.zeros(8))[2], theirs.step(np.zeros(8))[2]
            assert mine == other
            if mine:
                ended.append(step)
                break
    assert max(ended) > 0
    theirs.close()


def test_reward_is_the_sum_of_its_terms_and_follows_the_height(env: JumpingAnt) -> None:
    env.reset(seed=0)
    for action in torques(100):
        observation, reward, _, _, info = env.step(action)
        terms = [value for key, value in info.items() if key.startswith("reward_")]
        assert reward == sum(terms)
        assert info["torso_height"] == observation[0] == env.data.qpos[2]
        assert reward == pytest.approx(10 * np.clip(observation[0] - 0.6, 0, 1))


def test_the_seed_determines_the_episodes(env: JumpingAnt) -> None:
    def run(seed: int) -> np.ndarray:
        first, _ = env.reset(seed=seed)
        steps = [env.step(action)[0] for action in torques(20)]
        return np.array([first, *steps, env.reset()[0]])

    np.testing.assert_array_equal(run(1), run(1))
    assert (run(1)[0] != run(2)[0]).all()
    assert (run(1)[-1] != run(1)[0]).all()  # the next episode starts otherwise


def test_start_states_are_as_noisy_as_asked(robot_xml: str, known_params: Params) -> None:
    still = JumpingAnt(robot_xml, task(known_params, reset_noise_scale=0.0))
    observation, info = still.reset(seed=0)
    assert info["torso_height"] == observation[0] == 0.75
    np.testing.assert_array_equal(observation, [0.75, 1] + [0] * 25)


def test_an_episode_is_cut_at_the_limit(robot_xml: str, known_params: Params) -> None:
    env = JumpingAnt(robot_xml, task(known_params, max_episode_steps=3))
    for _ in range(2):
        env.reset(seed=0)
        assert [env.step(np.zeros(8))[2:4] for _ in range(3)] == [
            (False, False),
            (False, False),
            (False, True),
        ]


def test_a_fall_at_the_limit_is_a_fall(robot_xml: str, known_params: Params) -> None:
    env = JumpingAnt(robot_xml, task(known_params, max_episode_steps=1, min_torso_height=5.0))
    env.reset(seed=0)
    assert env.step(np.zeros(8))[2:4] == (True, False)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200])
def test_a_state_that_breaks_down_ends_the_episode(env: JumpingAnt, bad: float) -> None:
    env.reset(seed=0)
    env.data.qvel[7] = bad
    observation, reward, terminated, truncated, _ = env.step(np.zeros(8))
    assert (terminated, truncated) == (True, False)
    assert np.isfinite(observation).all()
    assert np.isfinite(reward)
    assert env.reset()[0][0] > 0.5
    assert not env.step(np.zeros(8))[2]


def test_returned_observations_share_no_memory(env: JumpingAnt) -> None:
    returned = [env.reset(seed=0)[0], *(env.step(np.zeros(8))[0] for _ in range(3))]
    for index, one in enumerate(returned):
        assert not np.shares_memory(one, env.data.qpos)
        assert not np.shares_memory(one, env.data.qvel)
        assert all(not np.shares_memory(one, other) for other in returned[:index])


def test_discrete_commands_are_the_torques_of_the_table(env: JumpingAnt) -> None:
    discrete = DiscreteCommands(env)
    assert discrete.action_space == gym.spaces.Discrete(5)
    discrete.reset(seed=0)
    for number in range(5):
        discrete.step(number)
        np.testing.assert_array_equal(env.data.ctrl, COMMANDS[number])


def test_make_gives_the_robot_and_the_task_of_params_yaml() -> None:
    told = params_file.load()
    made = gym.make("JumpingAnt-v0")
    env: Any = made.unwrapped
    assert env.params == told.env
    same = JumpingAnt(robot.build(told.robot), told.env)
    np.testing.assert_array_equal(made.reset(seed=3)[0], same.reset(seed=3)[0])
    np.testing.assert_array_equal(made.step(torques(1)[0])[0], same.step(torques(1)[0])[0])
    made.close()


def test_pictures_are_shown_as_fast_as_the_robot_moves(
    robot_xml: str, known_params: Params
) -> None:
    env = JumpingAnt(robot_xml, task(known_params, frame_skip=4))
    assert (env.dt, env.metadata["render_fps"]) == (0.04, 25)


def test_pictures_are_drawn_without_a_screen() -> None:
    settings = ("MUJOCO_GL", "PYOPENGL_PLATFORM", "DISPLAY", "WAYLAND_DISPLAY")
    environment = {key: value for key, value in os.environ.items() if key not in settings}
    process = subprocess.run(
        [sys.executable, "-c", DRAW],
        cwd=PROJECT_ROOT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert process.returncode == 0, process.stderr
    assert "Traceback" not in process.stderr


def test_without_a_render_mode_nothing_is_drawn(env: JumpingAnt) -> None:
    env.reset(seed=0)
    assert env.render() is None
    env.close()
    env.close()


def test_other_render_modes_and_robots_are_refused(robot_xml: str, known_params: Params) -> None:
    with pytest.raises(ValueError, match="given 'ascii', allowed: None, 'human', 'rgb_array'"):
        JumpingAnt(robot_xml, known_params.env, render_mode="ascii")
    with pytest.raises(InputError, match="not valid MJCF"):
        JumpingAnt("<mujoco", known_params.env)
