"""The process that writes a run, as a tag of the run, and whether it still does."""

import os
import socket
import time
from pathlib import Path

import psutil  # type: ignore[import-untyped]
from mlflow.entities import Run

WRITER = "writer"  # a run's tag: host, process id, start of the process
SILENT_DAYS = 1  # a run of another host counts as abandoned if it started longer ago


def this_process() -> str:
    """Return the tag of a run that this process writes."""
    process_id = os.getpid()
    return f"{socket.gethostname()} {process_id} {_start(process_id)}"


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
    """Tell whether a process, given by id and start, still runs.

    An ended process keeps its id until its parent reaps it, which in containers may be never.
    """
    process_id, _, start = process.partition(" ")
    try:
        status = psutil.Process(int(process_id)).status()
        return _start(int(process_id)) == start and status != psutil.STATUS_ZOMBIE
    except (psutil.Error, OSError, ValueError):
        return False


def _start(process_id: int) -> str:
    """Return when a process started, in terms that do not change when the clock is set."""
    stat = Path(f"/proc/{process_id}/stat")
    if not stat.exists():  # not Linux
        return f"{psutil.Process(process_id).create_time():.2f}"
    ticks_since_boot = stat.read_text(encoding="utf-8").rpartition(")")[2].split()[19]
    boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="utf-8")
    return f"{boot[:8]}-{ticks_since_boot}"
