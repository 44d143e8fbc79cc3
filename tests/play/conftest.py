"""A project of five agents with trained policies, and its live page."""

from pathlib import Path

import pytest
import small_agents
from small_project import make_params, write_csv, write_project

from jumping_ant.agents.events import Finished
from jumping_ant.agents.job import trainer_of
from jumping_ant.base.files import write_bytes, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.params.model import Params
from jumping_ant.play import page
from jumping_ant.policies import policy_file
from jumping_ant.sim import robot
from jumping_ant.sim.world import World

AGENTS = {name: name for name in ("random", "open_loop", "dqn", "sac", "pgpe")}
SEEDS = [3, 1]  # the second does better in validation


@pytest.fixture(scope="session")
def settings() -> Params:
    return make_params(AGENTS, SEEDS)


@pytest.fixture(scope="session")
def project(tmp_path_factory: pytest.TempPathFactory, settings: Params) -> Path:
    """A project through all stages that the live page comes after."""
    root = tmp_path_factory.mktemp("project")
    write_project(root, AGENTS, SEEDS)
    xml = robot.build(settings.robot)
    write_text(root / "assets" / "edited.xml", xml)
    for name in AGENTS:
        agent = settings.agent(name)
        *_, finished = trainer_of(agent)(small_agents.job(World(xml, settings.env), agent, 0))
        assert isinstance(finished, Finished)
        for seed in SEEDS:
            paths = Paths(root).agent(name).seed(seed)
            write_bytes(paths.policy, policy_file.owned(finished.policy, (name, seed)))
            row = {"env_steps": 0, "episodes": 1, "return_mean": 10 - seed, "return_std": 0}
            write_csv(paths.validation, [{"agent": name, "seed": seed} | row])
    return root


@pytest.fixture(scope="session")
def live(project: Path, settings: Params) -> str:
    """The address of the page."""
    write_text(page.path(project), page.build(project, settings))
    return page.path(project).as_uri()
