"""A preset in a folder of its own."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from jumping_ant.base.errors import InputError, StoppedError, WorkerError
from jumping_ant.base.files import PROJECT_ROOT, write_text
from jumping_ant.params import params_file, presets
from scripts import checkout, preset
from scripts.checkout import Checkout

QUICK = presets.load("quick")
AGAIN = """
from pathlib import Path
from jumping_ant.base.errors import reported
from jumping_ant.params import presets
from scripts import preset
with reported():
    preset.run(Path.cwd(), presets.load("quick"))
"""


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    return tmp_path / ".presets" / "quick"


@pytest.fixture
def pipeline_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Have copies run a shell script in place of Python; `$AGAIN` runs the preset once more."""
    python, again = tmp_path / "python", tmp_path / "again.py"
    again.write_text(AGAIN, encoding="utf-8")
    variables = {"PATH": f"{tmp_path}:/bin:/usr/bin", "PYTHONPATH": str(PROJECT_ROOT)}
    monkeypatch.setattr(Checkout, "environment", variables | {"AGAIN": f"{sys.executable} {again}"})

    def replace(script: str) -> None:
        python.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
        python.chmod(0o755)

    return replace


def test_what_was_trained_elsewhere_is_not_trained_again(
    tmp_path: Path, copy: Path, pipeline_is: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    pipeline_is("exit 0")
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


def test_the_same_preset_does_not_run_twice_at_once(copy: Path, pipeline_is: Callable) -> None:
    """The code of the first run would change under it."""
    pipeline_is("$AGAIN 2> errors; exit 0")
    for _ in range(2):  # the first has ended
        preset.run(copy, QUICK)
        assert (copy / "errors").read_text(encoding="utf-8") == (
            f"error: {copy}: another process runs this preset; wait for its end, or stop it\n"
        )


def test_a_preset_whose_process_was_killed_still_runs(copy: Path, pipeline_is: Callable) -> None:
    """The pipeline that it started does: the lock is the pipeline's, too."""
    pipeline_is("kill -9 $PPID; sleep 1; $AGAIN 2> errors")
    copy.mkdir(parents=True)
    code = f"from scripts.checkout import Checkout\nCheckout.environment = {Checkout.environment}\n"
    killed = subprocess.run(
        [sys.executable, "-c", code + AGAIN],
        cwd=copy,
        env=os.environ | {"PYTHONPATH": str(PROJECT_ROOT)},
        capture_output=True,  # waits for what still writes
    )
    assert killed.returncode == -signal.SIGKILL
    errors = (copy / "errors").read_text(encoding="utf-8")
    assert "another process runs this preset" in errors


@pytest.mark.parametrize(
    ("script", "error", "message"),
    [
        ("exit 3", WorkerError, "ended with status 3; .* the same command resumes"),
        ("kill -INT $PPID; sleep 1; touch saved", StoppedError, "resumes from the last checkp"),
    ],
)
def test_a_pipeline_that_ends_early_has_saved_and_is_reported(
    copy: Path, pipeline_is: Callable, script: str, error: type[Exception], message: str
) -> None:
    pipeline_is(script)
    with pytest.raises(error, match=message):
        preset.run(copy, QUICK)
    assert (copy / "saved").exists() == ("saved" in script)


@pytest.mark.parametrize("stages", [[], ["compare", "timing"]], ids=["all", "some"])
def test_the_command_runs_stages_and_says_what_they_made(
    copy: Path,
    pipeline_is: Callable,
    stages: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    pipeline_is('echo "$PWD $@" > called')
    monkeypatch.setattr(preset, "folder_of", lambda name: copy)
    monkeypatch.setattr("sys.argv", ["preset", "quick", *stages])
    preset.main()
    called = (copy / "called").read_text(encoding="utf-8")
    assert called.split() == [str(copy), "-m", "scripts.repro", *stages]
    assert params_file.load(copy / "params.yaml") == QUICK
    text = (copy / "params.yaml").read_text(encoding="utf-8")
    assert params_file.check(yaml.safe_load(text)) == QUICK, "as YAML 1.1, too"
    assert text.startswith("# yaml-language-server: $schema=params.schema.json\n")
    assert (copy / ".venv").resolve() == (PROJECT_ROOT / ".venv").resolve()
    printed = capsys.readouterr().out
    assert f"{copy}/results" in printed
    assert (f"{copy}/results/report.html" in printed) == (not stages)
    assert "2 seeds show what the robot does; they prove nothing" in printed


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_renewed_copy_has_todays_code_and_all_that_is_not_the_projects(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    project, copy, code = tmp_path / "project", tmp_path / "copy", "jumping_ant/a.py"
    for name in (code, "robots/old.xml", ".dvc/config", "params.yaml"):
        write_text(project / name, "1")
    subprocess.run(["git", "init", "-q", project], check=True)
    monkeypatch.setattr(checkout, "PROJECT_ROOT", project)
    checkout.renew_project(copy, QUICK)
    (project / "robots" / "old.xml").unlink()
    write_text(project / code, "2")
    users = ["robots/mine.xml", "presets/mine", "docs/notes.md", ".dvc/config", "results/a.json"]
    for name in users:
        write_text(copy / name, "mine")
    checkout.renew_project(copy, QUICK)
    assert (copy / code).read_text(encoding="utf-8") == "2"
    assert not (copy / "robots" / "old.xml").exists()
    assert {(copy / name).read_text(encoding="utf-8") for name in users} == {"mine"}
    write_text(project / code, "3")
    write_text(project / "robots" / "mine.xml", "3")
    write_text(copy / "robots" / "mine.xml", "3")  # as it is in the project
    for name in (code, "params.yaml", "robots/mine.xml"):
        before = (copy / name).read_text(encoding="utf-8")
        write_text(copy / name, "mine")
        mine = contents(copy)
        with pytest.raises(InputError, match=f"copy: {name} changed since a preset was run there"):
            checkout.renew_project(copy, QUICK)
        assert contents(copy) == mine
        write_text(copy / name, before)
    (copy / ".dvc" / "tmp" / "preset.json").unlink()  # of a copy that an older version made
    write_text(copy / "params.yaml", "mine")
    with pytest.raises(InputError, match=r"params\.yaml changed"):
        checkout.renew_project(copy, QUICK)
