"""The process that writes a run, as a tag of the run, and whether it still does."""

import socket
import time

import psutil  # type: ignore[import-untyped]
from mlflow.entities import Run

WRITER = "writer"  # a run's tag: host, process id, when the process started
SILENT_DAYS = 1  # a run of another host counts as abandoned if it started longer ago


def this_process() -> str:
    """Return the tag of a run that this process writes."""
    process = psutil.Process()
    return f"{socket.gethostname()} {process.pid} {process.create_time():.2f}"


def is_written(run: Run) -> bool:
    """Tell whether some process is still writing a run."""
    if run.info.status != "RUNNING":
        return False
    host, _, process = run.data.tags.get(WRITER, "").partition(" ")
    if host == socket.gethostname():
        return exists(process)
    seconds = time.time() - run.info.start_time / 1000
    return bool(host) and seconds < SILENT_DAYS * 86_400


def is_own(run: Run) -> bool:
    """Tell whether this process is writing a run."""
    return run.info.status == "RUNNING" and run.data.tags.get(WRITER) == this_process()


def exists(process: str) -> bool:
    """Tell whether a process, given by id and start time, still runs.

    An ended process keeps its id until its parent reaps it, which in containers may be never.
    """
    process_id, _, created = process.partition(" ")
    try:
        found = psutil.Process(int(process_id))
        is_same = f"{found.create_time():.2f}" == created
        return is_same and found.status() != psutil.STATUS_ZOMBIE
    except (psutil.Error, ValueError):
        return False
