"""DQN and SAC compared with SBX, their Stable-Baselines3-compatible implementations in JAX."""

import os
from collections.abc import Callable
from functools import partial

from benchmarks import off_policy
from benchmarks.apart import compare_apart
from benchmarks.measure import Row


def dqn_vs_sbx() -> Row:
    """Compare DQN, on one core each."""
    return _compare("dqn")


def sac_vs_sbx() -> Row:
    """Compare SAC, on one core each."""
    return _compare("sac")


def _compare(algorithm: str) -> Row:
    ours, peer = partial(_project, algorithm), partial(_sbx, algorithm)
    return compare_apart(f"{algorithm}_vs_sbx", "env-steps/s", ours, peer, off_policy.REPEATS)


def _project(algorithm: str) -> Callable[[], float]:
    _use_one_core()
    return off_policy.project(algorithm)


def _sbx(algorithm: str) -> Callable[[], float]:
    _use_one_core()  # before JAX counts the cores
    return off_policy.script(algorithm, "sbx")


def _use_one_core() -> None:
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
