"""Commands that are stopped, or whose first stage fails, end there."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from jumping_ant.base.files import PROJECT_ROOT
from scripts.checkout import Checkout, copy_project

CTRL_C = "from . import run\nimport os, signal, time\nos.killpg(0, signal.SIGINT)\ntime.sleep(60)\n"


def started(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    """Run Python in a process group of its own, which Ctrl-C reaches as a whole."""
    return subprocess.Popen(
        [sys.executable, *arguments],
        cwd=folder,
        env=Checkout(folder).environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        start_new_session=True,
        # Shells have what they run in the background ignore Ctrl-C, these tests perhaps.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


@pytest.mark.parametrize("digest", ["raise SystemExit(3)\n", CTRL_C])
def test_the_pipeline_ends_with_its_first_stage(tmp_path: Path, digest: str) -> None:
    folder = tmp_path / "project"
    copy_project(folder)
    (folder / "stages" / "digest.py").write_text(digest, encoding="utf-8")
    process = started(folder, "-m", "scripts.repro")
    told, errors = process.communicate(timeout=300)
    assert told.count("Running stage 'digest'") == 1
    assert process.returncode and "Traceback" not in errors
    assert errors.splitlines()[-1].startswith("ERROR: failed to reproduce 'digest'")


def test_ctrl_c_ends_a_script_in_a_line() -> None:
    code = "import os, scripts.preset, signal; os.kill(os.getpid(), signal.SIGINT)"
    process = started(PROJECT_ROOT, "-c", code)
    assert process.communicate(timeout=300) == ("", "stopped by Ctrl-C\n")
    assert process.returncode == -signal.SIGINT
