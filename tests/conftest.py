"""What many tests share: the project's own parameters, and the robot built from them."""

import pytest

from jumping_ant import params, robot
from jumping_ant.params import Params


@pytest.fixture(scope="session")
def real_params() -> Params:
    """`params.yaml` as it is."""
    return params.load()


@pytest.fixture(scope="session")
def robot_xml(real_params: Params) -> str:
    """The robot of `params.yaml`, as MJCF text."""
    return robot.build(real_params.robot)


@pytest.fixture(scope="session")
def source_xml() -> str:
    """Gymnasium's own Ant, unedited."""
    return robot.SOURCE_PATH.read_text()
