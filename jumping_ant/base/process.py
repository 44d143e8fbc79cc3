"""Processes by a name that no other one has, and whether they still run."""

import os
import socket
from pathlib import Path

import psutil  # type: ignore[import-untyped]


def name_of(process_id: int) -> str:
    """Return the name of a process of this host: host, process id, boot and ticks at its start.

    Unlike the time of its start, these stay the same when somebody sets the clock.
    """
    ticks = Path(f"/proc/{process_id}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="utf-8")
    return f"{socket.gethostname()} {process_id} {boot[:8]}-{ticks[19]}"


def this_process() -> str:
    """Return the name of this process."""
    return name_of(os.getpid())


def is_of_this_host(name: str) -> bool:
    """Tell whether a process, by its name, is or was one of this host."""
    return name.partition(" ")[0] == socket.gethostname()


def running(name: str) -> int | None:
    """Return the number of a process of this user, by its name; None if it does not run here."""
    if not (is_of_this_host(name) and exists(name)):
        return None
    number = int(name.split()[1])
    return number if psutil.Process(number).uids().real == os.getuid() else None


def exists(name: str) -> bool:
    """Tell whether a process of this host, by its name, still runs.

    An ended process keeps its id until its parent reaps it, which in containers may be never.
    """
    try:
        process_id = int(name.split()[1])
        is_same = name_of(process_id) == name
        return is_same and psutil.Process(process_id).status() != psutil.STATUS_ZOMBIE
    except (psutil.Error, OSError, ValueError, IndexError):
        return False
