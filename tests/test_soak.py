"""A little of `make soak`: each kind of ill treatment once, for real."""

import os
import pickle
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

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


@pytest.fixture(scope="module")
def evaluated(project: Checkout) -> Checkout:
    """The same project, with an agent trained, if it is not, and evaluated."""
    project.seconds("dvc", "repro", f"evaluate@{AGENT}")
    return project


def test_a_killed_pipeline_ends_with_the_same_bytes(project: Checkout) -> None:
    project.write_params(projects.settings(live_after_seconds=600))  # faults disturb MLflow
    killer = Killer(project, AGENT, random.Random(3), most=1)  # soon after a checkpoint
    for _ in range(5):
        killer.once()
        if "resumes from" in killer.log.read_text(encoding="utf-8"):
            break
    assert "resumes from" in killer.log.read_text(encoding="utf-8")
    assert killer.count.identical == killer.count.killed > 0


def test_a_server_that_never_answers_changes_no_byte_of_a_training(project: Checkout) -> None:
    """tests/training/test_resume.py and tests/tracking/test_live.py have the other faults."""
    faults = Faults(project, random.Random(0))
    faults.once("mlflow_slow")
    count = faults.counts["mlflow_slow"]
    assert (count.injected, count.survived) == (1, 1)


def test_files_cut_short_are_answered_clearly(evaluated: Checkout) -> None:
    count = inputs.give(evaluated, random.Random(0))
    assert count.troubles == []
    assert count.tried == count.clear == len(inputs.INPUTS)


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


@pytest.mark.parametrize(("stage", "seconds"), [("build", 0.3), ("record", 0.5), ("record", 1.5)])
def test_ctrl_c_ends_a_stage_in_one_line(evaluated: Checkout, stage: str, seconds: float) -> None:
    """While it imports, and while it works, by its own CPU time; it may also have ended before."""
    agents = () if stage == "build" else (AGENT,)
    process = subprocess.Popen(
        [sys.executable, "-m", f"stages.{stage}", *agents],
        cwd=evaluated.folder,
        env=evaluated.environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        start_new_session=True,
        # Shells have what they run in the background ignore Ctrl-C, these tests perhaps.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    watched = psutil.Process(process.pid)
    while process.poll() is None and watched.cpu_times().user < seconds:
        time.sleep(0.01)
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGINT)
    _, told = process.communicate(timeout=60)
    # Once its work is done, and Python clears up, the signal ends it silently.
    if process.returncode not in (0, -signal.SIGINT):
        assert told == "stopped: nothing already computed is lost\n"
        assert process.returncode == 130


def test_ctrl_c_while_an_extension_module_is_imported_ends_in_one_line(tmp_path: Path) -> None:
    """Extension modules made with pybind11 turn every exception into an ImportError."""
    (tmp_path / "extension.py").write_text(
        "import os, signal\n"
        "try:\n    os.kill(os.getpid(), signal.SIGINT)\n"
        "except BaseException as error:\n    raise ImportError('failed') from error\n",
        encoding="utf-8",
    )
    program = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    ended = subprocess.run(
        [sys.executable, "-c", program + "import stages, extension"],
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        encoding="utf-8",
    )
    assert ended.stderr == "stopped: nothing already computed is lost\n"
    assert ended.returncode == 130


def test_figures_of_parts_add_up() -> None:
    stored = {"minutes": 1.5, "kills": {"sac": {"killed": 2, "identical": 2}}, "payloads": {}}
    new = {"minutes": 0.2, "kills": {"sac": {"killed": 1, "identical": 0}}, "payloads": {}}
    assert added(stored, new) == {
        "minutes": 1.7,
        "kills": {"sac": {"killed": 3, "identical": 2}},
        "payloads": {},
    }
    assert added({}, new) == new
