"""What a person sees of a training: bars on a terminal, plain lines elsewhere."""

import io
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.training import progress
from jumping_ant.training.progress import TrainingProgress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Print every line at once."""
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_LINES", 0.0)


@pytest.mark.usefixtures("often")
def test_elsewhere_lines_say_how_far_each_seed_is() -> None:
    stream = io.StringIO()
    with TrainingProgress("sac", [0, 3], 20000, stream) as shown:
        shown.update(3, 100, 10.0, None)
        shown.update(0, 5000, 50.0, 1234.4)
        shown.update(0, 10000, 100.0, None)
        shown.finish(0, 20000, 200.0)
    assert stream.getvalue().splitlines() == [
        "sac: training 2 seeds; output is not a terminal, so a line per seed every 0 s",
        "sac seed 3: 100/20,000 steps, return -, 10 steps/s, 33:10 left",
        "sac seed 0: 5,000/20,000 steps, return 1,234, 100 steps/s, 02:30 left",
        "sac seed 0: 10,000/20,000 steps, return 1,234, 100 steps/s, 01:40 left",
        "sac seed 0: done, 20,000 steps in 03:20, return 1,234",
    ]


def test_lines_are_few() -> None:
    stream = io.StringIO()
    with TrainingProgress("dqn", [0], 1000, stream) as shown:
        for step in range(100):
            shown.update(0, 10 * step, 0.1 * step, 1.0)
    assert stream.getvalue().count("\n") == 1  # what is going on, and nothing yet


@pytest.mark.usefixtures("often")
def test_a_seed_that_has_not_begun_and_one_beyond_its_budget_divide_by_nothing() -> None:
    stream = io.StringIO()
    with TrainingProgress("random", [0], 0, stream) as shown:
        shown.update(0, 0, 0.0, None)
        shown.update(0, 10, 1.0, None)
        shown.finish(0, 10, 1.0)
    assert "10/0 steps, return -, 10 steps/s, 00:00 left" in stream.getvalue()


def test_a_terminal_has_a_bar_for_each_seed() -> None:
    stream = Terminal()
    with TrainingProgress("pgpe", [0, 1], 800, stream) as shown:
        shown.update(0, 400, 4.0, 512.6)
        shown.update(1, 800, 8.0, -3.0)
        shown.finish(1, 800, 8.0)
    text = stream.getvalue()
    assert "\r" in text
    assert "pgpe seed 0:  50%" in text
    assert "400/800" in text
    assert "return 513" in text
    assert "pgpe seed 1: 100%" in text
    assert "return -3" in text
    assert "not a terminal" not in text
    assert "done" not in text


def test_an_error_leaves_the_terminal_in_order() -> None:
    stream = Terminal()
    with pytest.raises(KeyboardInterrupt), TrainingProgress("pgpe", [0], 800, stream):
        raise KeyboardInterrupt
    assert stream.getvalue().endswith("\n")


@pytest.mark.parametrize("output", ["2>&-", "2>/dev/full", "2>&1 >&- | head -1", ">&- 2>&- <&-"])
def test_a_stage_goes_on_without_anyone_to_tell(tmp_path: Path, output: str) -> None:
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
