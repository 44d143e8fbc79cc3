"""The process that writes a run, as a tag of the run, and whether it still does."""

import time

from mlflow.entities import Run

from jumping_ant.base import process
from jumping_ant.base.process import this_process

WRITER = "writer"  # a run's tag: the name of the process
SILENT_DAYS = 1  # a run of another host counts as abandoned if it started longer ago


def is_written(run: Run) -> bool:
    """Tell whether some process is still writing a run."""
    if run.info.status != "RUNNING":
        return False
    writer = run.data.tags.get(WRITER, "")
    if process.is_of_this_host(writer):
        return process.exists(writer)
    seconds = time.time() - run.info.start_time / 1000
    return bool(writer) and seconds < SILENT_DAYS * 86_400


def is_own(run: Run) -> bool:
    """Tell whether this process is writing a run."""
    return run.info.status == "RUNNING" and run.data.tags.get(WRITER) == this_process()
