"""A project in which only some policies are trained, and nothing is evaluated."""

import shutil
from pathlib import Path

import pytest
from small_policies import NUMBERS
from small_project import write_csv

from jumping_ant.actions import ActionSet
from jumping_ant.base.paths import Paths
from jumping_ant.policies import policy_file
from jumping_ant.policies.blind import UniformPolicy

ROOT = Path(__file__).resolve().parents[2]
POLICIES = {  # by agent and seed; later seeds do better in validation
    ("random", 30): UniformPolicy(30, ActionSet(), 8),
    ("random", 35): UniformPolicy(35, ActionSet(), 8),
    ("metronome", 30): NUMBERS["open loop"],
    ("pgpe", 30): NUMBERS["linear"],
}


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory, robot_xml: str) -> Path:
    """A project with these policies and code of its own, which the edited robot plays in."""
    root = tmp_path_factory.mktemp("project")
    shutil.copytree(ROOT / "jumping_ant", root / "jumping_ant")
    shutil.copy(ROOT / "params.yaml", root)
    for name in ("edited", "unedited"):
        path = root / "assets" / f"{name}.xml"
        path.parent.mkdir(exist_ok=True)
        path.write_text(robot_xml, encoding="utf-8")
    for (agent, seed), policy in POLICIES.items():
        paths = Paths(root).agent(agent).seed(seed)
        paths.policy.parent.mkdir(parents=True)
        paths.policy.write_bytes(policy_file.owned(policy.to_bytes(), (agent, seed)))
        row = {"env_steps": 0, "episodes": 1, "return_mean": seed, "return_std": 0}
        write_csv(paths.validation, [{"agent": agent, "seed": seed} | row])
    return root
