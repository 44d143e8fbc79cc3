"""A study of seconds: PGPE with hardly any budget.

Usage: python tests/tuning/small_study.py FOLDER TRIALS [STORAGE] runs one, to be killed.
"""

import sqlite3
import sys
from pathlib import Path
from typing import Any

from jumping_ant.base.errors import reported
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.experiment import params_file
from jumping_ant.experiment.models import Params
from jumping_ant.tuning import space, tune

SMALL = {"generations": 2, "population_size": 4, "episode_steps": 20}
RANGES = {name: own for name, own in space.RANGES["pgpe"].items() if name not in SMALL}


def small_params(trials: int, workers: int = 1, **tuning: Any) -> Params:
    """Return the project's parameters with one small agent."""
    content = params_file.load().model_dump()
    content["agents"] = {"pgpe": content["agents"]["pgpe"] | SMALL}
    content["env"]["max_episode_steps"] = 40
    content["training"] |= {"evaluations": 2}
    content["compute"]["workers"] = workers
    content["evaluate"] |= {"episodes": 4, "baseline_episodes": 4}
    own = {"trials": trials, "seeds": 2, "share": 0.5, "episodes": 3, "fresh_seeds": 2}
    content["tuning"] |= own | tuning
    return params_file.check(content)


def project(folder: Path) -> Path:
    """Return a folder with what a study reads of a project."""
    folder.mkdir(parents=True, exist_ok=True)
    text = (PROJECT_ROOT / "params.yaml").read_text(encoding="utf-8")
    (folder / "params.yaml").write_text(text, encoding="utf-8")
    return folder


def records(database: Path) -> list[tuple[Any, ...]]:
    """Return every record of a study's trials: number, state, value, parameters, reports."""
    opened = sqlite3.connect(database)
    found = opened.execute(
        """
        SELECT number, state,
            (SELECT value FROM trial_values v WHERE v.trial_id = t.trial_id),
            (SELECT group_concat(p, ' ') FROM (SELECT param_name || '=' || param_value AS p
                FROM trial_params q WHERE q.trial_id = t.trial_id ORDER BY param_name)),
            (SELECT group_concat(r, ' ') FROM (SELECT step || ':' || intermediate_value AS r
                FROM trial_intermediate_values i WHERE i.trial_id = t.trial_id ORDER BY step))
        FROM trials t ORDER BY number
        """
    ).fetchall()
    opened.close()
    return found


if __name__ == "__main__":
    space.RANGES["pgpe"] = RANGES
    root, num_trials, *storage = sys.argv[1:]
    params = small_params(int(num_trials))
    with reported():
        tune.run(
            Path(root),
            params,
            "pgpe",
            storage=storage[0] if storage else None,
            say=lambda said: print(said, flush=True),
        )
