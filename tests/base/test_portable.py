"""The kernels of numerical libraries, the same on every processor."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from jumping_ant.base import portable
from jumping_ant.base.files import PROJECT_ROOT

ENTRIES = ("jumping_ant.sim.env", "stages.evaluate", "scripts.tune", "benchmarks.off_policy")
FLAGS = "processor\t: 0\nflags\t\t: fpu sse4_2 {}\n\nprocessor\t: 1\nflags\t\t: fpu\n"


@pytest.mark.skipif(not portable.is_supported(), reason="a processor with bytes of its own")
@pytest.mark.parametrize("module", ENTRIES)
def test_every_way_in_selects_them_before_libraries_are_loaded(module: str) -> None:
    selected = {*portable.SWITCHES, "MKL_CBWR"}  # the latter only where something trains
    variables = {name: own for name, own in os.environ.items() if name not in selected}
    program = (
        f"import {module}, numpy, os, threadpoolctl\n"
        "blas = [own for own in threadpoolctl.threadpool_info() if own['user_api'] == 'blas']\n"
        "print({(own['architecture'], own['num_threads']) for own in blas})\n"
        "print(numpy._core._multiarray_umath.__cpu_features__['X86_V4'])\n"
        "from jumping_ant.base import portable\n"
        "print(portable.SWITCHES.items() <= os.environ.items(), 'MKL_CBWR' in os.environ)\n"
    )
    command = [sys.executable, "-c", program]
    done = subprocess.run(
        command, cwd=PROJECT_ROOT, env=variables, encoding="utf-8", capture_output=True, check=True
    )
    assert done.stdout == "{('Haswell', 1)}\nFalse\nTrue False\n"


@pytest.mark.parametrize(
    ("flags", "supported"),
    [("avx avx2 fma", True), ("avx avx2", False), ("fma", False), ("", False)],
)
def test_processors_without_them_are_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, flags: str, supported: bool
) -> None:
    cpuinfo = tmp_path / "cpuinfo"
    cpuinfo.write_text(FLAGS.format(flags), encoding="utf-8")
    monkeypatch.setattr(portable, "CPUINFO", cpuinfo)
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    for name in portable.SWITCHES:
        monkeypatch.delenv(name, raising=False)
    assert portable.is_supported() is supported
    portable.switch()
    assert (portable.SWITCHES.items() <= os.environ.items()) is supported
    monkeypatch.setattr("platform.machine", lambda: "aarch64")
    assert not portable.is_supported()
    monkeypatch.setattr(portable, "CPUINFO", tmp_path / "missing")
    assert not portable.is_supported()
