"""A little of `make soak`: each kind of ill treatment once, for real."""

import os
import pickle
import random
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from jumping_ant.base.files import PROJECT_ROOT
from scripts.checkout import Checkout, checkout
from soak import inputs
from soak import project as projects
from soak.__main__ import added, change_files, interrupt_operations
from soak.faults import Faults
from soak.kills import Killer
from soak.payloads import Payload
from soak.project import AGENT

QUICK_TARGETS = ["build", "dvc"]


@pytest.fixture(scope="module")
def project() -> Iterator[Checkout]:
    with checkout() as copy:
        projects.prepare(copy)
        yield copy


def test_a_killed_pipeline_ends_with_the_same_bytes(project: Checkout) -> None:
    project.write_params(projects.settings(live_after_seconds=600))  # faults disturb MLflow
    killer = Killer(project, AGENT, random.Random(3), most=1)  # soon after a checkpoint
    for _ in range(5):
        killer.once()
        if "resumes from" in killer.log.read_text(encoding="utf-8"):
            break
    assert "resumes from" in killer.log.read_text(encoding="utf-8")
    assert killer.count["identical"] == killer.count["killed"] > 0


def test_a_server_that_never_answers_changes_no_byte_of_a_training(project: Checkout) -> None:
    """tests/training/test_resume.py and tests/tracking/test_live.py have the other faults."""
    faults = Faults(project, random.Random(0))
    faults.once("mlflow_slow")
    assert faults.counts["mlflow_slow"] == {"injected": 1, "survived": 1}


def test_files_cut_short_are_answered_clearly(project: Checkout) -> None:
    troubles: list[str] = []
    count = inputs.give(project, random.Random(0), troubles, each=1)
    assert troubles == []
    assert count["tried"] == count["clear"] == len(inputs.INPUTS)


def test_changed_bytes_are_read_or_refused_and_no_code_runs(
    project: Checkout, tmp_path: Path
) -> None:
    mark = tmp_path / "executed"
    pickle.loads(pickle.dumps(Payload(mark)))
    assert mark.exists(), "the payload would work"
    troubles: list[str] = []
    figures = change_files(project, 1, troubles, each=6)
    assert troubles == []
    counts = figures["mutations"]
    assert len(counts) > 10 and all(own["tried"] == own["clear"] > 0 for own in counts.values())
    assert figures["payloads"]["planted"] > 100 and figures["payloads"]["executed"] == 0


def test_interrupted_operations_are_survived(project: Checkout) -> None:
    troubles: list[str] = []
    counts = interrupt_operations(project, 0, troubles, QUICK_TARGETS, seconds=0)["operations"]
    assert troubles == []
    assert list(counts) == QUICK_TARGETS
    for kinds in counts.values():
        assert all(own["interrupted"] == own["survived"] > 0 for own in kinds.values())


def test_figures_of_parts_add_up() -> None:
    stored = {"minutes": 1.5, "kills": {"sac": {"killed": 2, "identical": 2}}, "payloads": {}}
    new = {"minutes": 0.2, "kills": {"sac": {"killed": 1, "identical": 0}}, "payloads": {}}
    assert added(stored, new) == {
        "minutes": 1.7,
        "kills": {"sac": {"killed": 3, "identical": 2}},
        "payloads": {},
    }
    assert added({}, new) == new


def test_some_settings_at_their_bounds_train_or_are_refused() -> None:
    """`python -m soak.bounds` tries them all; the seed is printed, and BOUNDS_SEED gives one."""
    given = ["--seed", seed] if (seed := os.environ.get("BOUNDS_SEED")) else []
    command = [sys.executable, "-m", "soak.bounds", "--cases", "60", *given]
    done = subprocess.run(command, cwd=PROJECT_ROOT, encoding="utf-8", capture_output=True)
    assert done.returncode == 0, done.stdout + done.stderr
