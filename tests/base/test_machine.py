"""The machine as a process sees it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from jumping_ant.base import machine


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="a system without affinity")
def test_cores_are_those_that_the_process_may_use() -> None:
    program = (
        "import os\n"
        "from jumping_ant.base import machine\n"
        "assert machine.num_cores() == len(os.sched_getaffinity(0))\n"
        "os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\n"
        "assert machine.num_cores() == 1\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


@pytest.mark.skipif(not Path("/proc/cpuinfo").exists(), reason="a system without it")
def test_the_processor_is_told_from_others_of_its_name() -> None:
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    told = machine.processor()
    for key in ("model name", "model"):
        value = next(line.split(": ")[1] for line in lines if line.split("\t")[0] == key)
        assert value in told
