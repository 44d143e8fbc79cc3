"""A study of seconds: PGPE with hardly any budget.

Usage: python tests/tuning/small_study.py FOLDER TRIALS [STORAGE] runs one, to be killed.
"""

import sqlite3
import sys
from functools import partial
from pathlib import Path
from typing import Any

from sqlalchemy import event
from sqlalchemy.engine import Engine

from jumping_ant.base.errors import reported
from jumping_ant.base.files import PROJECT_ROOT, write_text
from jumping_ant.params import params_file
from jumping_ant.params.model import Params
from jumping_ant.tuning import search, space, tune
from jumping_ant.tuning.task import SearchSettings

SMALL = {"generations": 2, "population_size": 4, "episode_steps": 20}
RANGES = {name: own for name, own in space.RANGES["pgpe"].items() if name not in SMALL}


@event.listens_for(Engine, "connect")
def _does_not_wait_for_the_disk(connection: Any, _: object) -> None:
    if isinstance(connection, sqlite3.Connection):
        connection.execute("PRAGMA synchronous = OFF")


def small_params(workers: int = 1) -> Params:
    """Return the project's parameters with one small agent."""
    content = params_file.load().model_dump()
    content["agents"] = {"pgpe": content["agents"]["pgpe"] | SMALL}
    content["env"]["max_episode_steps"] = 40
    content["training"] |= {"evaluations": 2}
    content["compute"]["workers"] = workers
    content["evaluate"] |= {"episodes": 4, "baseline_episodes": 4}
    return params_file.check(content)


def small_settings(trials: int, **more: Any) -> SearchSettings:
    """Return the settings of a search of small trainings."""
    small = {"seeds": 2, "share": 0.5, "episodes": 3, "fresh_seeds": 2}
    return SearchSettings(trials, **small | more)


def project(folder: Path) -> Path:
    """Return a folder with what a study reads of a project."""
    write_text(folder / "params.yaml", (PROJECT_ROOT / "params.yaml").read_text(encoding="utf-8"))
    return folder


if __name__ == "__main__":
    space.RANGES["pgpe"], search.HEARTBEAT, search.GRACE = RANGES, 1, 2
    root, num_trials, storage = [*sys.argv[1:], None][:3]
    with reported():
        settings = small_settings(int(num_trials or 0))
        say = partial(print, flush=True)
        tune.run(Path(root or ""), small_params(), "pgpe", settings, storage=storage, say=say)
