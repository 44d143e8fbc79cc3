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
from jumping_ant.params import presets
from scripts import preset
with reported():
    preset.run(Path.cwd(), presets.load("quick"))
"""
QUICK = presets.load("quick")


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    return tmp_path / ".presets" / "quick"


def replace_python(monkeypatch: pytest.MonkeyPatch, folder: Path, script: str) -> None:
    """Have copies find a shell script in place of Python."""
    (folder / "python").write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    (folder / "python").chmod(0o755)
    monkeypatch.setattr(Checkout, "environment", {"PATH": f"{folder}:/bin:/usr/bin"})


def run_again(folder: Path) -> str:
    """Return a shell command that runs the preset from its copy, with its errors in `told`."""
    (folder / "again.py").write_text(AGAIN, encoding="utf-8")
    return f"PYTHONPATH={PROJECT_ROOT} {sys.executable} {folder}/again.py 2> told"


def run_command(monkeypatch: pytest.MonkeyPatch, copy: Path, *stages: str) -> None:
    """Call the command with `quick` and stages."""
    monkeypatch.setattr(preset, "folder_of", lambda name: copy)
    monkeypatch.setattr("sys.argv", ["preset", "quick", *stages])
    preset.main()


def test_what_was_trained_elsewhere_is_not_trained_again(
    tmp_path: Path, copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace_python(monkeypatch, tmp_path, "exit 0")
    monkeypatch.setattr(preset, "PROJECT_ROOT", tmp_path)
    elsewhere = [
        ".checkpoints/sac/a1/seed-1.finished",
        ".presets/families/.checkpoints/sac/b2/seed-1.finished",
        ".checkpoints/sac/a1/seed-2.1.checkpoint",  # another process continues
        ".checkpoints/nobody/a1/seed-1.finished",
    ]
    for number, name in enumerate(elsewhere):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(str(number), encoding="utf-8")
    for _ in range(2):
        preset.run(copy, QUICK)
        found = {path.relative_to(copy / ".checkpoints"): path for path in copy.rglob("seed-*")}
        assert {str(name): path.read_text(encoding="utf-8") for name, path in found.items()} == {
            "sac/a1/seed-1.finished": "0",
            "sac/b2/seed-1.finished": "1",
        }


def test_a_pipeline_that_fails_is_reported(
    tmp_path: Path, copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace_python(monkeypatch, tmp_path, "exit 3")
    with pytest.raises(WorkerError, match="ended with status 3; .* the same command resumes"):
        preset.run(copy, QUICK)


def test_the_same_preset_does_not_run_twice_at_once(
    tmp_path: Path, copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The code of the first run would change under it."""
    replace_python(monkeypatch, tmp_path, f"{run_again(tmp_path)}; exit 0")
    for _ in range(2):  # the first has ended
        preset.run(copy, QUICK)
        told = (copy / "told").read_text(encoding="utf-8")
        assert told == (
            f"error: {copy}: another process runs this preset; wait for its end, or stop it\n"
        )


def test_a_preset_whose_process_was_killed_still_runs(
    tmp_path: Path, copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The pipeline that it started does: the lock is the pipeline's, too."""
    replace_python(monkeypatch, tmp_path, f"kill -9 $PPID; sleep 1; {run_again(tmp_path)}")
    copy.mkdir(parents=True)
    code = f"from scripts.checkout import Checkout\nCheckout.environment = {Checkout.environment}\n"
    killed = subprocess.run(
        [sys.executable, "-c", code + AGAIN],
        cwd=copy,
        env=os.environ | {"PYTHONPATH": str(PROJECT_ROOT)},
        capture_output=True,  # waits for what still writes
    )
    assert killed.returncode == -signal.SIGKILL
    assert "another process runs this preset" in (copy / "told").read_text(encoding="utf-8")


def test_an_interrupt_waits_for_the_pipeline_to_save(
    tmp_path: Path, copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace_python(monkeypatch, tmp_path, "kill -INT $PPID; sleep 1; touch saved")
    with pytest.raises(StoppedError, match="resumes from the last checkpoints"):
        preset.run(copy, QUICK)
    assert (copy / "saved").exists()


def test_some_stages_alone_can_be_asked_for(
    tmp_path: Path, copy: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    replace_python(monkeypatch, tmp_path, 'echo "$PWD $@" > called')
    run_command(monkeypatch, copy, "compare", "timing")
    called = (copy / "called").read_text(encoding="utf-8")
    assert called == f"{copy} -m scripts.repro compare timing\n"
    assert params_file.load(copy / "params.yaml") == QUICK
    told = capsys.readouterr().out
    assert f"{copy}/results" in told
    assert "report.html" not in told  # nobody has made it


def test_what_is_made_is_told_and_that_few_seeds_prove_nothing(
    tmp_path: Path, copy: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    replace_python(monkeypatch, tmp_path, "exit 0")
    run_command(monkeypatch, copy)
    told = capsys.readouterr().out
    assert f"{copy}/results/report.html" in told
    assert "2 seeds show what the robot does; they prove nothing" in told
    assert (copy / ".venv").resolve() == (PROJECT_ROOT / ".venv").resolve()
