"""The memory of a running command."""

import shlex
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import psutil  # type: ignore[import-untyped]

SECONDS_BETWEEN_SAMPLES = 1.0  # a sample costs some 10 ms


def peak(command: Sequence[str], folder: Path, environment: Mapping[str, str]) -> float:
    """Run a command; return the resident memory of all its processes together at the peak [GiB].

    Raises:
        RuntimeError: The command failed.
    """
    with tempfile.TemporaryFile("w+", encoding="utf-8") as output:
        process = subprocess.Popen(
            command, cwd=folder, env=environment, stdout=output, stderr=subprocess.STDOUT
        )
        family, most = {process.pid}, 0
        while process.poll() is None:
            most = max(most, _sample(family))
            time.sleep(SECONDS_BETWEEN_SAMPLES)
        output.seek(0)
        if process.returncode:
            raise RuntimeError(f"{shlex.join(command)} failed\n{output.read()}")
    return most / 2**30


def _sample(family: set[int]) -> int:
    """Return the memory [bytes] of a family of processes, to which their children are added."""
    total = 0
    for process in psutil.process_iter():  # parents come before their children
        with suppress(psutil.Error):
            if process.pid in family or process.ppid() in family:
                family.add(process.pid)  # it may outlive its parent
                memory = process.memory_full_info()
                # A page that several share counts proportionally.
                total += getattr(memory, "pss", memory.rss)
    return total
