"""The machine: its cores, and the properties that results may depend on.

Equal parameters give equal bytes on every processor that `jumping_ant.base.portable` supports, with
one thread for products. Other versions of MuJoCo, NumPy and torch give others.
"""

import importlib.metadata
import math
import os
import platform
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

PACKAGES = ("evotorch", "gymnasium", "mujoco", "numpy", "sb3-contrib", "stable-baselines3", "torch")
KEYS = ("cpu family", "model")  # in /proc/cpuinfo
CONTROL_GROUP = Path("/sys/fs/cgroup")
BLAS_THREADS = 1  # per worker; simulations may use more, which does not affect results


def describe() -> dict[str, Any]:
    """Return processor, operating system, versions and the number of BLAS threads."""
    return {
        "cpu": processor(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "versions": {name: importlib.metadata.version(name) for name in PACKAGES},
        "blas_threads": BLAS_THREADS,
    }


def num_cores() -> int:
    """Return how many cores this process may use; a container or scheduler may limit them."""
    if hasattr(os, "sched_getaffinity"):  # not on macOS
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def available_memory() -> float:
    """Return the bytes this process may still take, also in a container; infinity if unknown."""
    available = math.inf
    with suppress(OSError, ValueError, StopIteration):
        lines = Path("/proc/meminfo").read_text(encoding="utf-8").splitlines()
        line = next(line for line in lines if line.startswith("MemAvailable:"))
        available = 1024 * int(line.split()[1])
    with suppress(OSError, ValueError):  # the limit may be the word "max"
        limit = int((CONTROL_GROUP / "memory.max").read_text(encoding="utf-8"))
        available = min(
            available, limit - int((CONTROL_GROUP / "memory.current").read_text(encoding="utf-8"))
        )
    return available


def processor() -> str:
    """Return the processor's name and model, from `/proc/cpuinfo` if they are there, else the name.

    Clouds give one name to processors that compute with different instructions.
    """
    with suppress(OSError):
        first = Path("/proc/cpuinfo").read_text(encoding="utf-8").partition("\n\n")[0]
        fields = dict(re.findall(r"^(.*?)\s*: (.*)$", first, re.MULTILINE))
        if "model name" in fields:
            numbers = [f"{key.removeprefix('cpu ')} {fields[key]}" for key in KEYS if key in fields]
            return f"{fields['model name']} ({', '.join(numbers)})"
    return platform.processor() or platform.machine()
