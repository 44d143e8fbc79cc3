"""A project to train in."""

from pathlib import Path

import pytest


@pytest.fixture
def project(tmp_path: Path, robot_xml: str) -> Path:
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "edited.xml").write_text(robot_xml)
    return tmp_path
