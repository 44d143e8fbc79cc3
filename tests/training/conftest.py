"""A project to train in. Trainings in this process compute as those of workers do."""

from pathlib import Path

import pytest
import small_agents

from jumping_ant.agents.catalogue import demonstrated
from jumping_ant.agents.kernels import use_portable_kernels
from jumping_ant.base.files import write_bytes, write_text
from jumping_ant.base.paths import Paths

use_portable_kernels()  # before anything computes


@pytest.fixture
def project(tmp_path: Path, robot_xml: str) -> Path:
    folder = tmp_path / "a ?#% 'folder' \"x\""  # any name will do
    write_text(folder / "assets" / "edited.xml", robot_xml)
    for algorithm in demonstrated():
        path = Paths(folder).demonstrations(algorithm)
        write_bytes(path, small_agents.demonstrations(robot_xml))
    return folder
