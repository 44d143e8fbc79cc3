import pytest

from jumping_ant.params.model import Params
from jumping_ant.sim.world import World


@pytest.fixture(scope="session")
def world(robot_xml: str, known_params: Params) -> World:
    return World(robot_xml, known_params.env)
