"""The machine as a process sees it."""

import os
import subprocess
import sys

import pytest


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
