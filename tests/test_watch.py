"""Watching a policy in MuJoCo's window: which one, what is printed, and how it ends."""

import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from small_policies import NUMBERS
from small_project import write_csv

from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import params_file
from jumping_ant.policies import policy_file
from jumping_ant.sim import rollout
from jumping_ant.sim.world import World
from scripts import watch

ROOT = Path(watch.__file__).parents[1]
RETURNS = {("metronome", 30): 900, ("sac", 30): 1, ("sac", 35): 5, ("pgpe", 30): 3}  # in validation
POLICY = NUMBERS["linear"]  # holds its choices for four steps


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory, robot_xml: str) -> Path:
    """A project with code of its own, short episodes and these policies."""
    root = tmp_path_factory.mktemp("project")
    for name in ("jumping_ant", "scripts"):
        shutil.copytree(ROOT / name, root / name)
    text = (ROOT / "params.yaml").read_text(encoding="utf-8")
    text = re.sub(r"max_episode_steps: \d+", "max_episode_steps: 10", text)
    (root / "params.yaml").write_text(text, encoding="utf-8")
    (root / "assets").mkdir()
    (root / "assets" / "edited.xml").write_text(robot_xml, encoding="utf-8")
    for owner, mean in RETURNS.items():
        paths = Paths(root).agent(owner[0]).seed(owner[1])
        paths.policy.parent.mkdir(parents=True)
        paths.policy.write_bytes(policy_file.owned(POLICY.to_bytes(), owner))
        row = {"env_steps": 0, "episodes": 1, "return_mean": mean, "return_std": 0}
        write_csv(paths.validation, [{"agent": owner[0], "seed": owner[1]} | row])
    return root


def test_the_best_is_chosen_and_others_are_refused(root: Path) -> None:
    params = params_file.load(root / "params.yaml")
    assert watch.choose(root, params, None, None) == ("sac", [35, 30]), "a baseline is no learner"
    assert watch.choose(root, params, "sac", 30) == ("sac", [30, 35])
    with pytest.raises(InputError, match="agent: given 'nobody', allowed: random, "):
        watch.choose(root, params, "nobody", None)
    with pytest.raises(InputError, match="seed of sac: given 31, allowed: 30, 35$"):
        watch.choose(root, params, "sac", 31)
    with pytest.raises(InputError, match="none yet; `dvc repro train@dqn` trains them"):
        watch.choose(root, params, "dqn", None)
    with pytest.raises(InputError, match="none yet; `make repro` trains them"):
        watch.choose(root / "assets", params, None, None)


def started(root: Path, display: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "scripts.watch", "sac", "--seed", "30"],
        cwd=root,
        env=os.environ | {"DISPLAY": display, "WAYLAND_DISPLAY": ""},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        # Shells have what they run in the background ignore Ctrl-C, these tests perhaps.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def test_without_a_display_the_live_page_is_named(root: Path) -> None:
    watching = started(root, "")
    _, errors = watching.communicate()
    assert watching.returncode == 2 and errors.count("\n") == 1
    assert errors.startswith("error: display: no window opens here (") and "play.html" in errors


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no Xvfb here")
def test_episodes_are_those_of_the_evaluation(root: Path, robot_xml: str) -> None:
    params = params_file.load(root / "params.yaml")
    seeds = params.evaluate.block(30)[:2]
    expected = rollout.returns(World(robot_xml, params.env), [(POLICY, seed) for seed in seeds])
    server = subprocess.Popen(["Xvfb", "-displayfd", "1"], stdout=subprocess.PIPE, encoding="ascii")
    with server, started(root, f":{server.stdout.readline().strip()}") as watching:
        for number, total in enumerate(expected):
            line = f"sac, seed 30, episode {number}: return {total:,.1f} in 10 steps\n"
            assert watching.stdout.readline() == line
        watching.send_signal(signal.SIGINT)
        assert watching.communicate()[1] == "stopped by Ctrl-C\n"
        server.terminate()
