"""A throw-away copy of the project whose trainings take seconds."""

import subprocess
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil  # type: ignore[import-untyped]

from jumping_ant.base.paths import Paths
from jumping_ant.params import params_file
from jumping_ant.params.model import Params
from scripts.checkout import Checkout

SEEDS = [0, 1]
AGENT = "pgpe"  # trains the fastest
METRONOME = {"half_periods": [3], "episodes": 2, "episode_steps": 50}
# Large enough that a training lasts for several checkpoints, small enough for many trainings.
BUDGETS: dict[str, dict[str, Any]] = {
    "dqn": {"total_steps": 16_000, "learning_starts": 500, "log_interval": 500},
    "sac": {"total_steps": 2_400, "learning_starts": 200, "log_interval": 100},
    **dict.fromkeys(("metronome", "metronome-full", "metronome-unedited"), METRONOME),
    "pgpe": {"generations": 24, "population_size": 10, "episode_steps": 30},
}
LEARNERS = ("dqn", "sac", "pgpe")
DEMONSTRATIONS = {"agent": AGENT, "steps": 400, "episode_steps": 100}
DEMONSTRATIONS |= {"tumbled_starts": 0.25, "seed": 6_000_000}
LITTLE: dict[str, dict[str, Any]] = {
    "dqn": {"total_steps": 1_200, "learning_starts": 200, "net_arch": [32, 32]},
    "sac": {"total_steps": 600, "learning_starts": 100, "net_arch": [32, 32]},
}
CHECKPOINT_SECONDS = 0.3

Count = dict[str, int]  # how often something was tried, and how often it went as it should


def settings(**compute: float) -> Params:
    """Return the project's parameters, cut down, with changes to their block `compute`."""
    content = params_file.load().model_dump()
    content["seeds"] = SEEDS
    content["env"]["max_episode_steps"] = 100
    content["training"] |= {"evaluations": 3, "evaluation_episodes": 4}
    content["training"] |= {"finalists": 2, "finalist_episodes": 3}
    content["compute"] |= {"checkpoint_seconds": CHECKPOINT_SECONDS} | compute
    content["evaluate"] |= {"episodes": 2, "baseline_episodes": 2}
    content["record"] |= {"width": 160, "height": 120}
    content["demonstrations"] = {"bc": DEMONSTRATIONS}
    for agent, budget in BUDGETS.items():
        content["agents"][agent] |= budget
    return params_file.check(content)


def settings_of(*agents: str) -> Params:
    """Return the same with fewer agents, which train a little in the stage's own process."""
    content = settings().model_dump()
    content["agents"] = {agent: content["agents"][agent] for agent in agents}
    if DEMONSTRATIONS["agent"] not in agents:
        content["demonstrations"] = {}
    for agent in set(agents) & LITTLE.keys():
        content["agents"][agent] |= LITTLE[agent]
    content["env"]["max_episode_steps"] = 60
    content["robustness"]["episode_steps"] = 20
    content["compute"]["workers"] = 1
    content["compare"]["bootstrap_samples"] = 200
    return params_file.check(content)


def prepare(project: Checkout) -> None:
    """Write the parameters, and build the robot."""
    (project.folder / "dvc.lock").unlink()  # DVC reads and writes all of it after each stage
    project.write_params(settings())
    project.seconds("dvc", "repro", "build")


def start(project: Checkout, *command: str, log: Path, **variables: str) -> subprocess.Popen[bytes]:
    """Start a command in a process group of its own, its output going to a file."""
    with log.open("ab") as file:
        return subprocess.Popen(
            command,
            cwd=project.folder,
            env=project.environment | variables,
            stdout=file,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )


def family(process: subprocess.Popen[bytes]) -> list[psutil.Process]:
    """Return a process and all its descendants."""
    try:
        top = psutil.Process(process.pid)
        return [top, *top.children(recursive=True)]
    except psutil.NoSuchProcess:
        return []


def command_line(process: psutil.Process) -> str:
    """Return the command line of a process, nothing if it has ended."""
    try:
        return " ".join(process.cmdline())
    except psutil.Error:
        return ""


def kill(processes: list[psutil.Process]) -> None:
    """Kill processes, and wait until they are gone."""
    for process in processes:
        with suppress(psutil.NoSuchProcess):
            process.kill()
    psutil.wait_procs(processes, timeout=30)


def await_checkpoint(project: Checkout, agent: str, process: subprocess.Popen[bytes]) -> None:
    """Wait for an agent's next checkpoint, or the end of a process."""

    def newest() -> int:
        paths = (project.folder / ".checkpoints" / agent).rglob("*.checkpoint")
        return max((int(path.suffixes[-2][1:]) for path in paths), default=0)

    before = newest()
    while process.poll() is None and newest() <= before:
        time.sleep(0.01)


def digests(project: Checkout, agent: str) -> list[dict[str, str]]:
    """Return the digests of the files of an agent's seeds."""
    paths = Paths(project.folder).agent(agent)
    return [paths.seed(seed).digests() for seed in SEEDS]
