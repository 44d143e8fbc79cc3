"""Processes by name, and whether they still run."""

import os
import signal
import subprocess
import time

import psutil

from jumping_ant.base import process


def test_a_process_that_ended_writes_no_more_though_none_took_note() -> None:
    child = subprocess.Popen(["sleep", "60"])
    name = process.name_of(child.pid)
    assert process.exists(name)
    os.kill(child.pid, signal.SIGKILL)
    while psutil.Process(child.pid).status() != psutil.STATUS_ZOMBIE:
        time.sleep(0.01)
    assert not process.exists(name)
    child.wait()
    assert not process.exists(name)
