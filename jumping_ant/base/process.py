"""Processes by a name that no other one has, and whether they still run."""

import os
import socket

import psutil  # type: ignore[import-untyped]

SAME_START = 60.0  # [s] two processes of one id start further apart


def name_of(process_id: int) -> str:
    """Return the name of a process of this host: host, process id, time of its start [s]."""
    return f"{socket.gethostname()} {process_id} {psutil.Process(process_id).create_time():.0f}"


def this_process() -> str:
    """Return the name of this process."""
    return name_of(os.getpid())


def is_of_this_host(name: str) -> bool:
    """Tell whether a process, by its name, is or was one of this host."""
    return name.partition(" ")[0] == socket.gethostname()


def exists(name: str) -> bool:
    """Tell whether a process of this host, by its name, still runs.

    An ended process keeps its id until its parent reaps it, which in containers may be never.
    """
    try:
        _, process_id, start = name.split()
        process = psutil.Process(int(process_id))
        is_same = abs(process.create_time() - float(start)) < SAME_START
        return is_same and process.status() != psutil.STATUS_ZOMBIE
    except (psutil.Error, ValueError):
        return False
