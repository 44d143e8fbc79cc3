"""The machine: its cores, and the properties that results may depend on (see `base.portable`)."""

import importlib.metadata
import os
import platform
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

PACKAGES = ("evotorch", "gymnasium", "mujoco", "numpy", "sb3-contrib", "stable-baselines3", "torch")
KEYS = ("cpu family", "model")  # in /proc/cpuinfo
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


def processor() -> str:
    """Return the processor's name, from `/proc/cpuinfo` with the model, which clouds hide in it."""
    with suppress(OSError):
        first = Path("/proc/cpuinfo").read_text(encoding="utf-8").partition("\n\n")[0]
        fields = dict(re.findall(r"^(.*?)\s*: (.*)$", first, re.MULTILINE))
        if "model name" in fields:
            numbers = [f"{key.removeprefix('cpu ')} {fields[key]}" for key in KEYS if key in fields]
            return f"{fields['model name']} ({', '.join(numbers)})"
    return platform.processor() or platform.machine()
