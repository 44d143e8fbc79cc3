"""Watching a policy in MuJoCo's window: which one, what is printed, and how it ends."""

import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import committed
import pytest
from small_policies import NUMBERS
from small_project import write_csv

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT, write_all
from jumping_ant.base.paths import Paths
from jumping_ant.params import params_file
from jumping_ant.policies import policy_file
from jumping_ant.sim import rollout
from jumping_ant.sim.world import World
from scripts import watch

RETURNS = {("metronome", 30): 900, ("sac", 30): 1, ("sac", 35): 5, ("pgpe", 30): 3}  # in validation
POLICY = NUMBERS["linear"]  # holds its choices for four steps


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory, robot_xml: str) -> Path:
    """A copy of the project with short episodes and these policies."""
    root = tmp_path_factory.mktemp("project")
    for name in ("jumping_ant", "scripts"):
        shutil.copytree(PROJECT_ROOT / name, root / name)
    text = committed.text("params.yaml")
    text = re.sub(r"max_episode_steps: \d+", "max_episode_steps: 10", text)
    write_all({root / "params.yaml": text, root / "assets" / "edited.xml": robot_xml})
    for owner, mean in RETURNS.items():
        paths = Paths(root).agent(owner[0]).seed(owner[1])
        write_all({paths.policy: policy_file.owned(POLICY.to_bytes(), owner)})
        row = {"env_steps": 0, "episodes": 1, "return_mean": mean, "return_std": 0}
        write_csv(paths.validation, [{"agent": owner[0], "seed": owner[1]} | row])
    return root


def test_the_best_is_chosen_and_others_are_refused(root: Path) -> None:
    params = params_file.load(root / "params.yaml")
    assert watch.choose(root, params, None, None) == ("sac", [35, 30]), "a baseline is no learner"
    assert watch.choose(root, params, "sac", 30) == ("sac", [30, 35])
    for folder, agent, seed, message in [
        (root, "nobody", None, "agent: given 'nobody', allowed: random, "),
        (root, "sac", 31, "seed of sac: given 31, allowed: 30, 35$"),
        (root, "dqn", None, "of dqn: none yet; `dvc repro train@dqn` trains them"),
        (root / "assets", None, None, "of learners: none yet; `make repro` trains them"),
    ]:
        with pytest.raises(InputError, match=message):
            watch.choose(folder, params, agent, seed)


def started(root: Path, display: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "scripts.watch", "sac", "--seed", "30"],
        cwd=root,
        env=os.environ | {"DISPLAY": display, "WAYLAND_DISPLAY": ""},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # ignored in background
    )


def test_without_a_display_the_live_page_is_named(root: Path) -> None:
    _, errors = (watching := started(root, "")).communicate()
    assert watching.returncode == 2 and errors.count("\n") == 1
    assert errors.startswith("error: display: no window opens here (") and "play.html" in errors


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no Xvfb here")
def test_episodes_are_those_of_the_evaluation(root: Path, robot_xml: str) -> None:
    params = params_file.load(root / "params.yaml")
    seeds = params.evaluate.block(30)[:2]
    plays = [rollout.Play(POLICY, seed) for seed in seeds]
    expected = rollout.returns(World(robot_xml, params.env), plays)
    server = subprocess.Popen(["Xvfb", "-displayfd", "1"], stdout=subprocess.PIPE, encoding="ascii")
    with server, started(root, f":{server.stdout.readline().strip()}") as watching:
        lines = [watching.stdout.readline() for _ in seeds]
        watching.send_signal(signal.SIGINT)
        _, errors = watching.communicate()
        server.terminate()
    line = "sac, seed 30, episode {}: return {:,.1f} in 10 steps\n"
    assert lines == [line.format(*played) for played in enumerate(expected)]
    assert errors == "stopped by Ctrl-C\n"
