"""Processes by name, and whether they still run."""

import os
import signal
import subprocess
import time

import psutil
import pytest

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


def test_setting_the_clock_ends_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that began at 12:00 by the old clock began at 11:00 by the new one."""
    name = process.this_process()
    began = psutil.Process.create_time
    monkeypatch.setattr(psutil.Process, "create_time", lambda self: began(self) - 3600)
    assert process.exists(name)
