"""What a person sees of work: bars on a terminal, elsewhere plain lines."""

import io
import os
import shlex
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from jumping_ant.base import progress
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.base.progress import Progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_line_has_the_seconds_of_work_alone_and_a_note(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_LINES", 0.0)
    with closing(Progress("sac seed 3", 20000, "steps")) as shown:
        shown.show(5000, 50.0, "return 1,234")
        shown.show(30000, 300.0)  # beyond its budget
        shown.finish(20000, 200.0, "return -")
    with closing(Progress("random", 0, "steps")) as shown:
        shown.show(0, 0.0)
    assert capsys.readouterr().err.splitlines() == [
        "sac seed 3: 5,000/20,000 steps, 100/s, 02:30 left, return 1,234",
        "sac seed 3: 30,000/20,000 steps, 100/s, 00:00 left",
        "sac seed 3: done, 20,000 steps in 03:20, return -",
        "random: 0/0 steps, 0/s, 00:00 left",
    ]


def test_parts_are_counted_once_they_are_used(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_LINES", 0.0)
    parts = progress.shown(["ab", "c"], 1200, "sac", "episodes")
    assert next(parts) == "ab" and capsys.readouterr().err == ""
    assert next(parts) == "c" and "sac: 2/1,200 episodes, " in capsys.readouterr().err
    assert list(parts) == [] and "sac: done, 3 episodes in 00:00" in capsys.readouterr().err
    assert not list(progress.shown(iter(()), 0, "random", "episodes"))
    assert capsys.readouterr().err == "", "nothing to do has no line"


def test_a_terminal_has_bars_above_which_lines_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stderr", terminal := Terminal())
    bars = [Progress(f"pgpe seed {seed}", 800, "steps") for seed in (0, 1)]
    progress.say("a line")
    bars[0].show(400, 4.0, "return 513")
    bars[1].show(800, 8.0)
    bars[1].finish(800, 8.0)
    for bar in bars:
        bar.close()
    text = terminal.getvalue()
    assert "a line\n" in text and "done" not in text
    assert "pgpe seed 0:  50%" in text and "400/800" in text and "return 513" in text
    assert "pgpe seed 1: 100%" in text
    assert text.endswith("\n")


@pytest.mark.parametrize("output", ["2>&-", "2>/dev/full", "2>&1 >&- | head -1", ">&- 2>&- <&-"])
def test_a_stage_continues_without_anyone_to_tell(tmp_path: Path, output: str) -> None:
    """Closed, full, or read by a process that has ended."""
    code = (
        "import sys, time; from stages import run\n"
        "def main():\n"
        "    for number in range(3):\n"
        "        print('progress', number, file=sys.stderr)\n"
        "        time.sleep(0.2)\n"
        "        print('more')\n"
        "    open('trained', 'x', encoding='utf-8').close()\n"
        "run(main)\n"
    )
    command = f"set -o pipefail; {shlex.join([sys.executable, '-c', code])} {output}"
    environment = os.environ | {"PYTHONPATH": str(PROJECT_ROOT)}
    subprocess.run(["bash", "-c", command], cwd=tmp_path, env=environment, check=True)
    assert (tmp_path / "trained").exists()
