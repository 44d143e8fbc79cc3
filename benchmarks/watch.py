"""Watch a running command: its time, its timed output, and the memory of all its processes."""

import shlex
import subprocess
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import psutil  # type: ignore[import-untyped]

SECONDS_BETWEEN_SAMPLES = 1.0  # a sample costs some 10 ms


@dataclass
class Usage:
    """Time, output and memory of a command.

    Attributes:
        seconds: Wall-clock time [s].
        lines: What it printed, each with its time [s since the start].
        peak_memory: Resident memory of all its processes together at the peak [GiB].
        peak_seconds: Time of the peak [s since the start].
    """

    seconds: float = 0.0
    lines: list[tuple[float, str]] = field(default_factory=list)
    peak_memory: float = 0.0
    peak_seconds: float = 0.0


def watch(
    command: Sequence[str],
    folder: Path,
    environment: Mapping[str, str],
    is_shown: bool = False,
) -> Usage:
    """Run a command in a folder and watch it; `is_shown` shows its output as well.

    Raises:
        RuntimeError: The command failed.
    """
    usage = Usage()
    started = time.perf_counter()
    process = subprocess.Popen(
        command,
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=None if is_shown else subprocess.STDOUT,
        encoding="utf-8",
    )
    has_ended = threading.Event()
    sampler = threading.Thread(target=_sample, args=(process.pid, usage, started, has_ended))
    sampler.start()
    with process:
        for line in process.stdout or ():
            usage.lines.append((time.perf_counter() - started, line.rstrip()))
            if is_shown:
                print(line, end="", flush=True)
    usage.seconds = time.perf_counter() - started
    has_ended.set()
    sampler.join()
    if process.returncode:
        printed = "" if is_shown else "\n".join(text for _, text in usage.lines)
        raise RuntimeError(f"{shlex.join(command)} failed\n{printed}")
    return usage


def _sample(pid: int, usage: Usage, started: float, has_ended: threading.Event) -> None:
    """Note the largest memory of a process and its descendants."""
    family = {pid}
    while not has_ended.wait(SECONDS_BETWEEN_SAMPLES):
        seconds, memory = time.perf_counter() - started, 0
        for process in psutil.process_iter():  # parents come before their children
            with suppress(psutil.Error):
                if process.pid in family or process.ppid() in family:
                    family.add(process.pid)  # it may outlive its parent
                    memory += _resident_bytes(process)
        if memory / 2**30 > usage.peak_memory:
            usage.peak_memory, usage.peak_seconds = memory / 2**30, seconds


def _resident_bytes(process: psutil.Process) -> int:
    """Return the memory of a process; a page shared by several counts proportionally."""
    memory = process.memory_full_info()
    return int(getattr(memory, "pss", memory.rss))
