"""A little of `make soak`: each kind of ill treatment once, for real."""

import os
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

from jumping_ant.base.errors import InputError
from jumping_ant.experiment import params_file
from scripts.checkout import Checkout, checkout
from soak import inputs, payloads
from soak import project as projects
from soak.__main__ import added, interrupt, mutate
from soak.faults import Faults
from soak.injector import AGENT
from soak.inputs import Inputs
from soak.kills import Killer

# The others are at home in the tests of their parts.
QUICK_TARGETS = ["digest", "build", "dvc"]
FAULTS = ["disk_full", "run_left_running", "diverging_simulation"]


@pytest.fixture(scope="module")
def project() -> Iterator[Checkout]:
    with checkout() as copy:
        projects.prepare(copy)
        yield copy


def test_a_killed_pipeline_ends_with_the_same_bytes(project: Checkout) -> None:
    killer = Killer(project, AGENT, random.Random(1), most=1)
    for _ in range(5):
        killer.once()
        if "resumes from" in killer.log.read_text(encoding="utf-8"):
            break
    assert "resumes from" in killer.log.read_text(encoding="utf-8")
    assert killer.count.identical == killer.count.killed > 0


@pytest.fixture(scope="module")
def faults(project: Checkout) -> Faults:
    return Faults(project, random.Random(0))


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_survived(faults: Faults, name: str) -> None:
    faults.once(name)
    count = faults.counts[name]
    assert (count.injected, count.survived) == (1, 1)


def test_bad_input_is_answered_clearly(project: Checkout, faults: Faults) -> None:
    project.seconds("dvc", "repro", f"evaluate@{AGENT}")
    given = Inputs(project, random.Random(0))
    given.try_another_robot()
    given.try_files()
    for _ in range(8):
        assert given.try_params()
    assert given.count.tried == 13
    assert given.unclear == [] and given.count.clear == given.count.tried


def test_changed_bytes_are_read_or_refused(project: Checkout, faults: Faults) -> None:
    troubles: list[str] = []
    counts = mutate(project, 1, troubles, each=15)["mutations"]
    assert troubles == []
    assert len(counts) > 10 and all(own["tried"] == own["clear"] >= 15 for own in counts.values())


def test_interrupted_operations_are_survived(project: Checkout, faults: Faults) -> None:
    troubles: list[str] = []
    counts = interrupt(project, 0, troubles, QUICK_TARGETS, seconds=0)["operations"]
    assert troubles == []
    assert list(counts) == QUICK_TARGETS
    for kinds in counts.values():
        assert all(own["interrupted"] == own["survived"] > 0 for own in kinds.values())


@pytest.mark.parametrize(("stage", "seconds"), [("build", 0.5), ("record", 0.5), ("record", 1.5)])
def test_ctrl_c_ends_a_stage_in_one_line(
    project: Checkout, faults: Faults, stage: str, seconds: float
) -> None:
    """While it imports, and while it works, by its own CPU time; it may also have ended before."""
    agents = () if stage == "build" else (AGENT,)
    if stage == "record":
        project.seconds("dvc", "repro", f"evaluate@{AGENT}")
    process = subprocess.Popen(
        [sys.executable, "-m", f"stages.{stage}", *agents],
        cwd=project.folder,
        env=project.environment,
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


def test_there_is_something_wrong_with_every_fault() -> None:
    """In one process, and so all of them: none is a value that may stand there after all."""
    settings = projects.settings()
    accepted = []
    for fault in inputs.params_faults(settings):
        try:
            params_file.check(fault.content)
        except InputError as error:
            assert f"params.yaml: {fault.key}" in str(error), (fault.key, str(error))
        else:
            accepted.append(fault.key)
    assert accepted == []


def test_planted_code_does_not_run(tmp_path: Path) -> None:
    count = payloads.plant_everywhere(tmp_path)
    assert count.planted > 20 and count.executed == 0


def test_figures_of_parts_add_up() -> None:
    stored = {"minutes": 1.5, "kills": {"sac": {"killed": 2, "identical": 2}}, "payloads": {}}
    new = {"minutes": 0.2, "kills": {"sac": {"killed": 1, "identical": 0}}, "payloads": {}}
    assert added(stored, new) == {
        "minutes": 1.7,
        "kills": {"sac": {"killed": 3, "identical": 2}},
        "payloads": {},
    }
    assert added({}, new) == new
