"""A preset in a folder of its own."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from jumping_ant.base.errors import StoppedError, WorkerError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.params import params_file, presets
from scripts import preset
from scripts.checkout import Checkout

AGAIN = """
from pathlib import Path
from jumping_ant.base.errors import reported
from scripts import preset
with reported():
    preset.run(Path.cwd(), presets.load("quick"))
"""


def replace_python(monkeypatch: pytest.MonkeyPatch, folder: Path, script: str) -> None:
    """Have copies find a shell script in place of Python."""
    (folder / "python").write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    (folder / "python").chmod(0o755)
    monkeypatch.setattr(Checkout, "environment", {"PATH": f"{folder}:/bin:/usr/bin"})


def run_quick(monkeypatch: pytest.MonkeyPatch, folder: Path, script: str, *stages: str) -> Path:
    """Call the command with `quick` and stages, run a script for Python, return the copy."""
    replace_python(monkeypatch, folder, script)
    copy = folder / ".presets" / "quick"
    monkeypatch.setattr(preset, "folder_of", lambda name: copy)
    monkeypatch.setattr("sys.argv", ["preset", "quick", *stages])
    preset.main()
    return copy


def test_the_pipeline_runs_in_a_copy_with_the_presets_parameters(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace_python(monkeypatch, tmp_path, 'echo "$PWD $@" > called')
    params, copy = presets.load("quick"), tmp_path / "copy"
    preset.run(copy, params)
    assert (copy / "called").read_text(encoding="utf-8") == f"{copy} -m scripts.repro\n"
    assert params_file.load(copy / "params.yaml") == params


def test_what_was_trained_elsewhere_is_not_trained_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace_python(monkeypatch, tmp_path, "exit 0")
    project, copy = tmp_path / "project", tmp_path / "project" / ".presets" / "quick"
    monkeypatch.setattr(preset, "PROJECT_ROOT", project)
    kept = [
        project / ".checkpoints" / "sac" / "a1" / "seed-1.finished",
        project / ".presets" / "families" / ".checkpoints" / "sac" / "b2" / "seed-1.finished",
    ]
    left = [
        project / ".checkpoints" / "sac" / "a1" / "seed-2.1.checkpoint",  # another process goes on
        project / ".checkpoints" / "nobody" / "a1" / "seed-1.finished",
    ]
    for number, path in enumerate(kept + left):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(str(number), encoding="utf-8")
    for _ in range(2):
        preset.run(copy, presets.load("quick"))
        found = {path.relative_to(copy / ".checkpoints"): path for path in copy.rglob("seed-*")}
        assert {str(name): path.read_text(encoding="utf-8") for name, path in found.items()} == {
            "sac/a1/seed-1.finished": "0",
            "sac/b2/seed-1.finished": "1",
        }


def test_a_pipeline_that_fails_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    replace_python(monkeypatch, tmp_path, "exit 3")
    with pytest.raises(WorkerError, match="ended with status 3; .* the same command resumes"):
        preset.run(tmp_path / "copy", presets.load("quick"))


def test_the_same_preset_does_not_run_twice_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The code of the first run would change under it."""
    (tmp_path / "again.py").write_text(AGAIN, encoding="utf-8")
    script = f"PYTHONPATH={PROJECT_ROOT} {sys.executable} {tmp_path}/again.py 2> told; exit 0"
    replace_python(monkeypatch, tmp_path, script)
    copy = tmp_path / "copy"
    preset.run(copy, presets.load("quick"))
    told = (copy / "told").read_text(encoding="utf-8")
    assert told.startswith(f"error: {copy}: another process runs this preset; wait")
    assert told.count("\n") == 1
    preset.run(copy, presets.load("quick"))


def test_a_preset_whose_process_was_killed_still_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The pipeline that it started does: the lock is the pipeline's, too."""
    (tmp_path / "again.py").write_text(AGAIN, encoding="utf-8")
    again = f"PYTHONPATH={PROJECT_ROOT} {sys.executable} {tmp_path}/again.py 2> told"
    replace_python(monkeypatch, tmp_path, f"kill -9 $PPID; sleep 1; {again}")
    (tmp_path / "copy").mkdir()
    code = f"from scripts.checkout import Checkout\nCheckout.environment = {Checkout.environment}\n"
    killed = subprocess.run(
        [sys.executable, "-c", code + AGAIN],
        cwd=tmp_path / "copy",
        env=os.environ | {"PYTHONPATH": str(PROJECT_ROOT)},
        capture_output=True,  # waits for what still writes
    )
    assert killed.returncode == -signal.SIGKILL
    told = (tmp_path / "copy" / "told").read_text(encoding="utf-8")
    assert "another process runs this preset" in told


def test_an_interrupt_waits_for_the_pipeline_to_save(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace_python(monkeypatch, tmp_path, "kill -INT $PPID; sleep 1; touch saved")
    with pytest.raises(StoppedError, match="resumes from the last checkpoints"):
        preset.run(tmp_path / "copy", presets.load("quick"))
    assert (tmp_path / "copy" / "saved").exists()


def test_some_stages_alone_can_be_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = run_quick(monkeypatch, tmp_path, 'echo "$@" > called', "compare", "timing")
    assert (copy / "called").read_text(encoding="utf-8") == "-m scripts.repro compare timing\n"
    told = capsys.readouterr().out
    assert f"{copy}/results" in told
    assert "report.html" not in told  # nobody has made it


def test_what_is_made_is_told_and_that_few_seeds_prove_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = run_quick(monkeypatch, tmp_path, "exit 0")
    told = capsys.readouterr().out
    assert f"{copy}/results/report.html" in told
    assert "2 seeds show what the robot does; they prove nothing" in told
    make = subprocess.run(
        ["make", "--dry-run", "install"], cwd=copy, encoding="utf-8", capture_output=True
    )
    assert "environment.sh packages" not in make.stdout  # the copy uses what is installed
