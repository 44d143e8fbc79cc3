"""Small trainings of every algorithm, and what they leave."""

import hashlib
import shutil
from pathlib import Path

import small_agents

from jumping_ant.agents.catalogue import row
from jumping_ant.params import params_file
from jumping_ant.params.model import Params

AGENTS = {name: row(agent) for name, agent in small_agents.PARAMS.agents.items()}
TRAINED = sorted(
    {
        agent.algorithm: name
        for name, agent in reversed(small_agents.PARAMS.agents.items())
        if not AGENTS[name].is_baseline
    }.values()
)
# For what is the same for all algorithms of a family.
ONE_OF_EACH = sorted({AGENTS[name].package: name for name in TRAINED}.values())
SMALL_OF_ALL = [*TRAINED, "random", "random-commands", "metronome"]


def small_params(workers: int) -> Params:
    """Return parameters with every algorithm, small, and two seeds."""
    settings = small_agents.PARAMS.model_dump()
    settings["seeds"] = [0, 5]
    settings["env"]["max_episode_steps"] = 40
    settings["training"] |= {"evaluations": 2, "evaluation_episodes": 4, "finalist_episodes": 3}
    settings["compute"]["workers"] = workers
    for demonstrations in settings["demonstrations"].values():
        demonstrations |= {"steps": 1000, "episode_steps": 40}
    for name in SMALL_OF_ALL:
        settings["agents"][name] |= small_agents.smaller(small_agents.PARAMS.agents[name])
    return params_file.check(settings)


def digests(folder: Path) -> dict[str, str]:
    """Return the digest of every file of a folder, by its path in it."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def forget(project: Path) -> None:
    """Remove what the next training would resume from."""
    shutil.rmtree(project / ".checkpoints")


class KillError(Exception):
    """Stands for a kill: nothing is tidied up after it."""
