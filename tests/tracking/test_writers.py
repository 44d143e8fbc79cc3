"""Processes that write to MLflow at the same time, and those that have ended."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from tracked_project import (
    content,
    query,
    runs,
    tracked,
)

from jumping_ant.tracking import writers


def test_two_at_once_lose_nothing_and_double_nothing(untracked_project: Path) -> None:
    """As two pipelines on one database do, which have trained the same policies."""
    program = (
        "import pathlib, sys; from jumping_ant.tracking.mirror import track\n"
        "track(pathlib.Path(sys.argv[1]))"
    )
    command = [sys.executable, "-c", program, str(untracked_project)]
    both = [subprocess.Popen(command, stdout=subprocess.DEVNULL) for _ in range(2)]
    assert [process.wait() for process in both] == [0, 0]
    assert tracked(untracked_project)[-1].endswith("4 unchanged")
    assert len(runs(untracked_project)) == 5
    names = query(untracked_project, "SELECT name FROM runs WHERE lifecycle_stage = 'active'")
    assert len(names) == 5
    assert len(content(untracked_project, "metrics", "sac-seed-1")) == 4 * 3 + 3 + 1 + 3 + 3


def test_two_make_one_database(tmp_path: Path) -> None:
    """MLflow alone leaves a broken one behind where two make its tables at once."""
    program = (
        "import pathlib, sys; from jumping_ant.tracking import store\n"
        "print(store.connect(pathlib.Path(sys.argv[1]), 5, 0).experiment_id)"
    )
    command = [sys.executable, "-c", program, str(tmp_path)]
    processes = [
        subprocess.Popen(command, stdout=subprocess.PIPE, encoding="utf-8") for _ in range(3)
    ]
    answers = [process.communicate()[0] for process in processes]
    assert [process.returncode for process in processes] == [0, 0, 0]
    assert len(set(answers)) == 1


def test_a_process_that_ended_writes_no_more_though_none_took_note() -> None:
    child = subprocess.Popen(["sleep", "60"])
    name = f"{child.pid} {writers._start(child.pid)}"
    assert writers.exists(name)
    os.kill(child.pid, signal.SIGKILL)
    while psutil.Process(child.pid).status() != psutil.STATUS_ZOMBIE:
        time.sleep(0.01)
    assert not writers.exists(name)
    child.wait()
    assert not writers.exists(name)


def test_setting_the_clock_ends_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that began at 12:00 by the old clock began at 11:00 by the new one."""
    process = writers.this_process().partition(" ")[2]
    began = psutil.Process.create_time
    monkeypatch.setattr(psutil.Process, "create_time", lambda self: began(self) - 3600)
    assert writers.exists(process)
