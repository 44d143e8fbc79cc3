"""A small project with results and their seconds."""

import pytest
from reported import AGENTS, SEEDS
from small_project import make_params, write_project
from timed_project import Timed, read

from jumping_ant.base.files import write_text
from jumping_ant.base.paths import Paths


@pytest.fixture(scope="session")
def timed(tmp_path_factory: pytest.TempPathFactory) -> Timed:
    root = tmp_path_factory.mktemp("timed")
    write_project(root, AGENTS, SEEDS)
    return read(root, make_params(AGENTS, SEEDS))


@pytest.fixture(scope="session")
def html(timed: Timed) -> str:
    text = timed.page()
    write_text(Paths(timed.root).speed_page, text)
    return text
