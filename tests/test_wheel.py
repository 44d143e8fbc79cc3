"""A wheel of a clone, installed into an empty environment: what it holds, and that it works."""

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from small_policies import linear_policy

from jumping_ant.base.files import PROJECT_ROOT
from scripts.checkout import copy_project

ACT = """
import sys
from importlib.resources import files
from pathlib import Path

import gymnasium as gym
import numpy as np

import jumping_ant.sim.env
from jumping_ant.policies import policy_file
from jumping_ant.params import params_file

envs = gym.make_vec("JumpingAnt-v0", num_envs=3)
observations, _ = envs.reset(seed=0)
policy = policy_file.load(Path("policy.zip"))
policy.start(range(3))
for _ in range(20):
    observations, rewards, *_ = envs.step(policy.act(observations))
env = gym.make("JumpingAnt-v0")
env.reset(seed=0)
env.step(env.action_space.sample())
assert params_file.load(params_file.DEFAULTS).agents["sac"].algorithm == "sac"
report = files("jumping_ant") / "report"
pages = ("template.html", "style.css", "charts.js", "films.js")
assert all((report / name).is_file() for name in pages)
assert "site-packages" in jumping_ant.__file__
assert not {"torch", "mlflow", "dvc", "ray", "pandas"} & set(sys.modules)
print("rewards", rewards)
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Python of an environment that holds the wheel and what it cannot do without."""
    folder = tmp_path_factory.mktemp("wheel")
    copy_project(folder / "clone")
    build = ["wheel", "-q", "--no-deps", "--no-build-isolation", "-w", folder, folder / "clone"]
    subprocess.run([sys.executable, "-m", "pip", *build], check=True)
    (wheel,) = folder.glob("*.whl")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "venv"], check=True)
    python = folder / "venv" / "bin" / "python"
    # Without the hashes: the lock has none of this wheel.
    lock = (PROJECT_ROOT / "requirements.lock").read_text(encoding="utf-8")
    versions = folder / "versions.txt"
    versions.write_text("\n".join(re.findall(r"^[\w.-]+==\S+", lock, re.M)), encoding="utf-8")
    install = ["--python", python, "install", "-q", "--no-compile", "-c", versions, wheel]
    subprocess.run([sys.executable, "-m", "pip", *install], check=True)
    return python


def test_the_environment_steps_and_a_policy_acts(installed: Path, tmp_path: Path) -> None:
    (tmp_path / "policy.zip").write_bytes(linear_policy().to_bytes())
    printed = subprocess.check_output([installed, "-I", "-c", ACT], cwd=tmp_path, encoding="utf-8")
    assert printed.startswith("rewards [")


def test_the_stages_work_on_the_folder_that_one_is_in(installed: Path, tmp_path: Path) -> None:
    shutil.copy(PROJECT_ROOT / "params.yaml", tmp_path)
    build = [installed, "-I", "-m", "jumping_ant.stages.build"]
    subprocess.run(build, cwd=tmp_path, check=True)
    assert (tmp_path / "assets" / "edited.xml").is_file()
    (packages,) = installed.parents[1].glob("lib/python*/site-packages")
    assert not any((packages / name).exists() for name in ("stages", "scripts", "soak", "tests"))


def test_every_package_is_named() -> None:
    project = tomllib.loads((PROJECT_ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    library = PROJECT_ROOT / "jumping_ant"
    packages = [path.parent.relative_to(PROJECT_ROOT) for path in library.rglob("__init__.py")]
    mapped = {"jumping_ant.stages", "jumping_ant.defaults"}
    named = set(project["tool"]["setuptools"]["packages"])
    assert named == {".".join(path.parts) for path in packages} | mapped
