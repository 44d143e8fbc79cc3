"""Commands that are stopped, or whose first stage fails, end there and in a line."""

import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from jumping_ant.base.files import PROJECT_ROOT
from scripts.checkout import Checkout, copy_project
from soak import project as projects
from soak.project import AGENT

STOPPED = "stopped: nothing already computed is lost\n"
CTRL_C = "from . import run\nimport os, signal, time\nos.killpg(0, signal.SIGINT)\ntime.sleep(60)\n"
# Extension modules made with pybind11 turn every exception into an ImportError.
EXTENSION = """
import os, signal
try:
    os.kill(os.getpid(), signal.SIGINT)
except BaseException as error:
    raise ImportError('failed') from error
"""


def started(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    """Run Python in a process group, which Ctrl-C reaches as a whole."""
    return subprocess.Popen(
        [sys.executable, *arguments],
        cwd=folder,
        env=Checkout(folder).environment | {"PYTHONPATH": str(folder)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        start_new_session=True,
        # Shells have what they run in the background ignore Ctrl-C, these tests perhaps.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("stops") / "project"
    copy_project(folder)
    return folder


@pytest.mark.parametrize("digest", ["raise SystemExit(3)\n", CTRL_C])
def test_the_pipeline_ends_with_its_first_stage(project: Path, digest: str) -> None:
    path = project / "stages" / "digest.py"
    before = path.read_text(encoding="utf-8")
    path.write_text(digest, encoding="utf-8")
    process = started(project, "-m", "scripts.repro")
    printed, errors = process.communicate(timeout=300)
    path.write_text(before, encoding="utf-8")
    assert printed.count("Running stage 'digest'") == 1
    assert process.returncode and "Traceback" not in errors
    assert errors.splitlines()[-1].startswith("ERROR: failed to reproduce 'digest'")


@pytest.mark.parametrize(("stage", "seconds"), [("build", 0.3), ("record", 0.5), ("record", 1.5)])
def test_ctrl_c_ends_a_stage_in_a_line(project: Path, stage: str, seconds: float) -> None:
    """While it imports, and while it works, by its CPU time; it may also have ended before."""
    if stage == "record" and not (project / "models" / AGENT).exists():
        projects.prepare(Checkout(project))
        Checkout(project).seconds("dvc", "repro", f"evaluate@{AGENT}")
    process = started(project, "-m", f"stages.{stage}", *([AGENT] if stage == "record" else []))
    watched = psutil.Process(process.pid)
    while process.poll() is None and watched.cpu_times().user < seconds:
        time.sleep(0.01)
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    # Once its work is done, and Python clears up, the signal ends it silently.
    if process.returncode not in (0, -signal.SIGINT):
        assert (errors, process.returncode) == (STOPPED, 130)


@pytest.mark.parametrize(
    ("name", "old", "new", "kept"),
    [
        ("params.yaml", "stdev_init:", "stdev_init: 0.25 #", 2),
        ("jumping_ant/agents/evolution/trainer.py", "import numpy", "import this, numpy", 0),
    ],
)
def test_what_changed_while_it_trained_is_not_taken(
    project: Path, name: str, old: str, new: str, kept: int
) -> None:
    """Seeds of the parameters that it had loaded are kept, of other code none."""
    checkout, path, stage = Checkout(project), project / name, f"train@{AGENT}"
    projects.prepare(checkout)
    shutil.rmtree(project / ".checkpoints", ignore_errors=True)
    before, log = path.read_text(encoding="utf-8"), project / "log.txt"
    process = projects.start(checkout, "dvc", "repro", stage, log=log)
    projects.await_checkpoint(checkout, AGENT, process)
    path.write_text(before.replace(old, new, 1), encoding="utf-8")
    assert process.wait(timeout=300)
    path.write_text(before, encoding="utf-8")
    assert ", while " in log.read_text(encoding="utf-8")
    assert stage not in (project / "dvc.lock").read_text(encoding="utf-8")
    again = checkout.run("dvc", "repro", stage)
    assert (again.stderr.count("trained before"), again.returncode) == (kept, 0)


def test_ctrl_c_while_an_extension_module_is_imported_ends_a_stage_in_a_line(project: Path) -> None:
    (project / "extension.py").write_text(EXTENSION, encoding="utf-8")
    process = started(project, "-c", "import stages, extension")
    assert process.communicate(timeout=300) == ("", STOPPED)
    assert process.returncode == 130


def test_ctrl_c_ends_a_script_in_a_line() -> None:
    code = "import os, scripts.preset, signal; os.kill(os.getpid(), signal.SIGINT)"
    process = started(PROJECT_ROOT, "-c", code)
    assert process.communicate(timeout=300) == ("", "stopped by Ctrl-C\n")
    assert process.returncode == -signal.SIGINT
