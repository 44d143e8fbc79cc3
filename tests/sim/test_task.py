"""A robot and its task: actions, observations and start states."""

import pickle

import gymnasium as gym
import mujoco
import numpy as np
import pytest
from commands import COMMAND_SIGNS

from jumping_ant.base.errors import InputError
from jumping_ant.params import article
from jumping_ant.params.blocks import ActionParams
from jumping_ant.params.model import Params
from jumping_ant.policies.actions import ActionSet
from jumping_ant.sim import robot
from jumping_ant.sim.task import Task
from jumping_ant.sim.world import World


@pytest.fixture(scope="module")
def task(robot_xml: str, known_params: Params) -> Task:
    return Task(World(robot_xml, known_params.env))


COMMANDS = ActionSet.of(ActionParams(kind="commands", amplitude=0.5, hold=1), article.ENV.commands)
TORQUES = ActionSet.of(ActionParams(kind="torques", amplitude=0.25, hold=4), article.ENV.commands)


def test_the_five_commands_are_the_articles(task: Task) -> None:
    assert task.action_space(COMMANDS) == gym.spaces.Discrete(5)
    signs = [[0] * 8, [1] * 8, [-1] * 8, [1] * 4 + [-1] * 4, [-1] * 4 + [1] * 4]
    assert (2 * COMMANDS.torques(np.arange(5))).tolist() == signs


def test_torques_are_scaled_by_the_amplitude(task: Task) -> None:
    assert task.action_space(TORQUES) == gym.spaces.Box(-1, 1, (8,), np.float32)
    assert TORQUES.hold == 4
    chosen = np.linspace(-1, 1, 16, dtype=np.float32).reshape(2, 8)
    assert TORQUES.torques(chosen).tolist() == (chosen / 4).tolist()


def test_two_levels_are_the_signs_of_the_outputs(task: Task) -> None:
    actions = ActionSet(amplitude=0.25, levels=2)
    assert task.action_space(actions) == gym.spaces.MultiDiscrete([2] * 8)
    outputs = np.array([[3.0, 1e-30, 0.0, -0.0, -1e-30, -0.2, -7.0, 0.9]], dtype=np.float32)
    choices = actions.choices(outputs)
    assert task.action_space(actions).contains(choices[0])
    assert (4 * actions.torques(choices)).tolist() == [[1, 1, 1, 1, -1, -1, -1, 1]]


def test_outputs_go_to_the_nearest_of_three_levels() -> None:
    actions = ActionSet(amplitude=0.5, levels=3)
    outputs = np.array([[3.0, 0.5, 0.49, 0.0, -0.49, -0.5, -0.51, -2.0]])
    torques = actions.torques(actions.choices(outputs))
    assert torques.tolist() == [[0.5, 0.5, 0, 0, 0, 0, -0.5, -0.5]], "halfway: the upper one"


def test_the_best_choice_is_that_of_each_motors_highest_value() -> None:
    values = np.array([[0, 2, 1, 5, 4, 3], [7, 0, 0, 0, 0, 9]])
    assert ActionSet(levels=3).best(values).tolist() == [[1, 0], [0, 2]]
    assert ActionSet(levels=2).best(values).tolist() == [[1, 1, 0], [0, 0, 1]]
    assert ActionSet(COMMAND_SIGNS).best(values).tolist() == [3, 5]


def test_random_choices_cover_the_set() -> None:
    generator = np.random.default_rng(0)
    drawn = [tuple(COMMANDS.sample(generator, 8)) for _ in range(1000)]
    counts = [drawn.count(tuple(row)) for row in COMMANDS.torques(np.arange(5))]
    assert sum(counts) == 1000 and min(counts) > 150
    torques = np.array([TORQUES.sample(generator, 8) for _ in range(1000)])
    assert 0.24 < torques.max() <= 0.25 and -0.25 <= torques.min() < -0.24
    np.testing.assert_allclose(torques.mean(axis=0), 0, atol=0.025)
    levels = ActionSet(amplitude=0.25, levels=3)
    drawn = np.array([levels.sample(generator, 8) for _ in range(1000)])
    shares = [(drawn == level).mean(axis=0) for level in (-0.25, 0, 0.25)]
    np.testing.assert_allclose(shares, 1 / 3, atol=0.06)


def test_the_first_motors_drive_the_front_legs_and_the_others_the_back_legs(robot_xml: str) -> None:
    model = robot.load(robot_xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    bodies = model.jnt_bodyid[model.actuator_trnid[:, 0]]
    ahead = data.xpos[bodies, 0] - data.body("torso").xpos[0]
    assert (ahead[:4] > 0.1).all() and (ahead[4:] < -0.1).all()


@pytest.mark.parametrize(
    ("xml", "message"),
    [
        (robot.source_path("hopper").read_text(encoding="utf-8"), "rows of 8 torques, allowed: th"),
        ("<mujoco", "robot XML: not valid MJCF"),
    ],
    ids=["fewer motors", "no robot"],
)
def test_a_robot_that_does_not_fit_is_refused(known_params: Params, xml: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Task(World(xml, known_params.env))


def test_what_arrives_in_another_process_is_text_and_parameters(
    robot_xml: str, known_params: Params
) -> None:
    world = World(robot_xml, known_params.env)
    before = pickle.dumps(world)
    assert world.anatomy.num_motors == 8 and world.dt == 0.05
    assert pickle.dumps(world) == before
    arrived = pickle.loads(before)
    assert arrived == world and vars(arrived).keys() == {"xml", "env"}


def test_observe_hides_where_the_robot_is_and_what_is_not_finite(task: Task) -> None:
    qpos, qvel = np.arange(30.0).reshape(2, 15), np.arange(28.0).reshape(2, 14)
    qvel[0, 3] = np.inf
    first = [*range(2, 15), *range(14)]
    first[13 + 3] = 0
    assert task.observe(qpos, qvel).tolist() == [first, [*range(17, 30), *range(14, 28)]]


def test_start_states_are_as_noisy_as_asked(robot_xml: str, known_params: Params) -> None:
    generator = np.random.default_rng(0)
    world = World(robot_xml, known_params.env.model_copy(update={"reset_noise_scale": 0.2}))
    noisy = Task(world)
    states = [noisy.start_state(generator) for _ in range(2000)]
    offsets = np.array([qpos for qpos, _ in states]) - world.model.qpos0
    speeds = np.array([qvel for _, qvel in states])
    assert 0.19 < np.abs(offsets).max() < 0.2
    np.testing.assert_allclose(offsets.std(axis=0), 0.2 / np.sqrt(3), rtol=0.1)
    np.testing.assert_allclose(speeds.std(axis=0), 0.2, rtol=0.1)
