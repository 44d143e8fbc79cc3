"""Nothing phones home."""

import os
import re
import subprocess
import sys

import pytest

from jumping_ant.base import telemetry
from jumping_ant.base.files import PROJECT_ROOT


def test_make_switches_off_the_same() -> None:
    makefile = (PROJECT_ROOT / "Makefile").read_text(encoding="utf-8")
    exported = dict(re.findall(r"^export (\w+) := (true|0)$", makefile, re.MULTILINE))
    assert exported == telemetry.SWITCHES


@pytest.mark.parametrize("module", ["stages", "jumping_ant.tracking"])
def test_who_imports_what_reports_switches_it_off(module: str) -> None:
    program = f"import os, {module}; print(*(os.environ[name] for name in {[*telemetry.SWITCHES]}))"
    own = {name: value for name, value in os.environ.items() if name not in telemetry.SWITCHES}
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=PROJECT_ROOT,
        env=own | {"RAY_USAGE_STATS_ENABLED": "1"},
        encoding="utf-8",
        capture_output=True,
        check=True,
    )
    expected = telemetry.SWITCHES | {"RAY_USAGE_STATS_ENABLED": "1"}  # asked for, and so left on
    assert done.stdout.split() == list(expected.values())
