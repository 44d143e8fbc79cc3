"""Processes by a name that no other one ever has, and whether they still run."""

import os
import socket
from pathlib import Path

import psutil  # type: ignore[import-untyped]


def this_process() -> str:
    """Return the name of this process: host, process id, start of the process."""
    process_id = os.getpid()
    return f"{socket.gethostname()} {process_id} {_start(process_id)}"


def is_of_this_host(name: str) -> bool:
    """Tell whether a process, by its name, is or was one of this host."""
    return name.partition(" ")[0] == socket.gethostname()


def exists(name: str) -> bool:
    """Tell whether a process of this host, by its name, still runs.

    An ended process keeps its id until its parent reaps it, which in containers may be never.
    """
    process_id, _, start = name.partition(" ")[2].partition(" ")
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
