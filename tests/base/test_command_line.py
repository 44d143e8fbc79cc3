"""What commands do first, in processes of their own: nothing phones home, garbage is left."""

import os
import re
import subprocess
import sys

import pytest

from jumping_ant.base.command_line import TELEMETRY
from jumping_ant.base.files import PROJECT_ROOT


def printed(program: str, environment: dict[str, str] | None = None) -> list[str]:
    """Return the words that a program prints."""
    command = [sys.executable, "-c", program]
    done = subprocess.run(
        command, cwd=PROJECT_ROOT, env=environment, encoding="utf-8", stdout=-1, check=True
    )
    return done.stdout.split()


def test_make_switches_off_the_same() -> None:
    makefile = (PROJECT_ROOT / "Makefile").read_text(encoding="utf-8")
    exported = dict(re.findall(r"^export (\w+) := (true|0)$", makefile, re.MULTILINE))
    assert exported == TELEMETRY


@pytest.mark.parametrize("module", ["stages", "jumping_ant.tracking"])
def test_who_imports_what_reports_switches_it_off(module: str) -> None:
    program = f"import os, {module}; print(*(os.environ[name] for name in {[*TELEMETRY]}))"
    others = {name: value for name, value in os.environ.items() if name not in TELEMETRY}
    wanted = {"RAY_USAGE_STATS_ENABLED": "1"}  # and so left on
    assert printed(program, others | wanted) == list((TELEMETRY | wanted).values())
