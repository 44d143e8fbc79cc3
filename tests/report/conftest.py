"""A project through all stages that the report comes after, and its report."""

import json
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from recorded import simulate
from reported import AGENTS, FILM, SEEDS, write_summaries
from small_project import block, make_params, shown, write_project

from jumping_ant.base.files import write_bytes, write_json, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.media import rendering
from jumping_ant.params.model import Params
from jumping_ant.report import page
from jumping_ant.sim import robot


@pytest.fixture(scope="session")
def settings(known_params: Params) -> Params:
    record = known_params.record.model_copy(update=FILM)
    agents = {name: block(algorithm) for name, algorithm in AGENTS.items()}
    evaluate = make_params(AGENTS, SEEDS).evaluate
    return known_params.model_copy(
        update={"seeds": SEEDS, "record": record, "agents": agents, "evaluate": evaluate}
    )


@pytest.fixture(scope="session")
def project(tmp_path_factory: pytest.TempPathFactory, settings: Params, robot_xml: str) -> Path:
    """A project through all stages that the report comes after."""
    root = tmp_path_factory.mktemp("project")
    write_project(root, AGENTS, SEEDS)
    write_text(root / "assets" / "edited.xml", robot_xml)
    write_text(root / "assets" / "unedited.xml", robot.unedited(settings.robot))
    write_json(root / "assets" / "robot.json", robot.summarize(settings.robot, robot_xml))
    model = mujoco.MjModel.from_xml_string(robot_xml)
    for number, name in enumerate(AGENTS):
        episode = simulate(model, np.zeros((40, 8)), upward_speed=float(number))
        write_bytes(Paths(root).agent(name).trajectory, shown(root, name, episode).to_bytes())
        film = rendering.film(robot_xml, episode, settings.record, processes=1)
        write_bytes(root / "media" / f"{name}.mp4", film)
        for seed in SEEDS:
            write_bytes(Paths(root).agent(name).seed(seed).policy, f"{name} {seed}".encode())
    write_summaries(root, settings, lambda seed: 1 - 0.01 * seed)
    return root


@pytest.fixture(scope="session")
def summary(project: Path) -> dict[str, Any]:
    """The project's comparison."""
    return json.loads(Paths(project).comparison.read_text(encoding="utf-8"))


@pytest.fixture(scope="session")
def html(project: Path, settings: Params) -> str:
    text = page.build(project, settings)
    write_text(project / "results" / "report.html", text)
    return text
