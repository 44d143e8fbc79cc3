"""Stages that play episodes write the same files on a cluster as without one."""

import shutil
import sys
from collections.abc import Iterator

import pytest

from jumping_ant.base.files import write_text
from jumping_ant.training import driver
from scripts.checkout import Checkout, checkout
from soak import project as projects

STAGES, AGENTS = ("evaluate", "robustness"), ("dqn", "pgpe")
PLAY = """
import importlib, sys
from stages import run
stage, sys.argv[1:] = importlib.import_module(f"stages.{sys.argv[1]}"), sys.argv[2:]
run(stage.main)
"""


@pytest.fixture(scope="module")
def project(robot_xml: str) -> Iterator[Checkout]:
    """A project with two seeds of each agent."""
    settings = projects.settings_of(*AGENTS)
    with checkout() as project:
        write_text(project.folder / "assets" / "edited.xml", robot_xml)
        for agent in AGENTS:
            driver.train(project.folder, settings, agent)
        compute = settings.compute.model_copy(update={"workers": 0})
        project.write_params(settings.model_copy(update={"compute": compute}))
        yield project


@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize("agent", AGENTS)
def test_the_files_are_the_same(
    project: Checkout, ray_address: str, monkeypatch: pytest.MonkeyPatch, stage: str, agent: str
) -> None:
    told, written, results = [], [], project.folder / "results"
    for address in ("local", ray_address):
        monkeypatch.setenv("RAY_ADDRESS", address)
        shutil.rmtree(results)
        done = project.run(sys.executable, "-c", PLAY, stage, agent)
        told.append(done.stderr.splitlines())
        written.append({path: path.read_bytes() for path in results.rglob("*.*")})
    assert told[0]
    assert all(line.startswith(f"{agent}: ") and " episodes" in line for line in told[0])
    assert told[1] == []  # what workers say stays on their machines
    assert written[0] == written[1]
    assert len(written[0]) == {"evaluate": 5, "robustness": 1}[stage]
