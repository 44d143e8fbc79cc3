"""The machine: its cores, and the properties that the bytes of results depend on.

On one machine equal parameters give equal bytes. On another the last digits may differ: a different
processor, BLAS, or number of BLAS threads sums matrix products in a different order, and learning
amplifies the differences. Other versions of MuJoCo, NumPy and torch differ more.
"""

import importlib.metadata
import os
import platform
from contextlib import suppress
from pathlib import Path
from typing import Any

PACKAGES = ("evotorch", "gymnasium", "mujoco", "numpy", "stable-baselines3", "torch")
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
    """Return the processor's name, from `/proc/cpuinfo` if it has one, else from Python."""
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        names = [line.partition(": ")[2] for line in lines if line.startswith("model name")]
        if names:
            return names[0]
    return platform.processor() or platform.machine()
