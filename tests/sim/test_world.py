"""A robot and its task: equal, copied and sent by what they are given."""

import pickle

import pytest

from jumping_ant.base.errors import InputError
from jumping_ant.params.model import Params
from jumping_ant.sim.world import World


def test_what_arrives_in_another_process_is_text_and_parameters(
    robot_xml: str, known_params: Params
) -> None:
    world = World(robot_xml, known_params.env)
    before = pickle.dumps(world)
    assert world.anatomy.num_motors == 8 and world.dt == 0.05
    assert pickle.dumps(world) == before
    arrived = pickle.loads(before)
    assert arrived == world and vars(arrived).keys() == {"xml", "env"}
    assert world.model is world.model and arrived.model is not world.model


def test_a_text_that_is_no_robot_is_refused_when_it_is_compiled(known_params: Params) -> None:
    with pytest.raises(InputError, match="robot XML"):
        _ = World("<mujoco", known_params.env).anatomy
