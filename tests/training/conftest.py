"""A project to train in."""

from pathlib import Path

import pytest
import small_agents

from jumping_ant.agents.catalogue import demonstrated
from jumping_ant.base.files import write_bytes
from jumping_ant.base.paths import Paths


@pytest.fixture
def project(tmp_path: Path, robot_xml: str) -> Path:
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "edited.xml").write_text(robot_xml, encoding="utf-8")
    for algorithm in demonstrated():
        path = Paths(tmp_path).demonstrations(algorithm)
        write_bytes(path, small_agents.demonstrations(robot_xml))
    return tmp_path
