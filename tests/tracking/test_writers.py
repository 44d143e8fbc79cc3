"""Processes that write to MLflow at the same time, and those that have ended."""

import json
from pathlib import Path

from tracked_project import meaning, parent_name, query, run_python, runs, tracked

from jumping_ant.base.files import PROJECT_ROOT

TWO = """
import json, pathlib, sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from jumping_ant.tracking.mirror import track

def tracked(root):
    lines = []
    track(pathlib.Path(root), lines.append)
    return lines

with ProcessPoolExecutor(2, get_context("fork")) as two:
    print(json.dumps(list(two.map(tracked, [sys.argv[1]] * 2))))
"""


def test_two_rebuild_a_wiped_database_at_once(project: Path) -> None:
    """As two pipelines on one database do, which have trained the same policies.

    MLflow alone leaves a broken one behind where two make its tables at once.
    """
    said = meaning(project)
    key = parent_name(project, "sac-seed-0").removeprefix("comparison-")
    (project / "mlflow.db").unlink()
    told = json.loads(run_python(TWO, str(project), cwd=project, PYTHONPATH=str(PROJECT_ROOT)))
    waiter, builder = sorted(told, key=len)
    assert waiter[-1] == f"MLflow at sqlite:///{project}/mlflow.db: 4 unchanged"
    assert [line.partition(" (")[0] for line in builder] == [
        f"comparison {key}: created",
        "sac seed 0: created",
        "sac seed 1: created",
        "jumping-ant-sac: champion is version 2, validation return 601.0",
        "pgpe seed 0: created",
        "pgpe seed 1: created",
        "jumping-ant-pgpe: champion is version 2, validation return 601.0",
        f"comparison {key}: updated",
        f"MLflow at sqlite:///{project}/mlflow.db: 4 created",
    ]
    assert meaning(project) == said
    assert tracked(project)[-1].endswith("4 unchanged")
    assert len(query(project, "SELECT name FROM runs")) == len(runs(project)) == 7
    assert query(project, "SELECT count(*) FROM experiments WHERE name = 'jumping-ant'") == [(1,)]
