"""Watch a running command: its time, its timed output, and the memory of all its processes."""

import shlex
import subprocess
import threading
import time
import uuid
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import psutil  # type: ignore[import-untyped]

SECONDS_BETWEEN_SAMPLES = 1.0  # a sample costs some 10 ms
MARK = "JUMPING_ANT_WATCHED"  # a variable that every descendant of the command inherits


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
    mark = uuid.uuid4().hex
    started = time.perf_counter()
    process = subprocess.Popen(
        command,
        cwd=folder,
        env={**environment, MARK: mark},
        stdout=subprocess.PIPE,
        stderr=None if is_shown else subprocess.STDOUT,
        encoding="utf-8",
    )
    has_ended = threading.Event()
    sampler = threading.Thread(target=_sample, args=(mark, usage, started, has_ended))
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


def _sample(mark: str, usage: Usage, started: float, has_ended: threading.Event) -> None:
    family: dict[psutil.Process, bool] = {}
    while not has_ended.wait(SECONDS_BETWEEN_SAMPLES):
        seconds = time.perf_counter() - started
        family = _judged(mark, family)
        members = (process for process, is_member in family.items() if is_member)
        memory = sum(map(_resident_bytes, members)) / 2**30
        if memory > usage.peak_memory:
            usage.peak_memory, usage.peak_seconds = memory, seconds


def _judged(mark: str, known: dict[psutil.Process, bool]) -> dict[psutil.Process, bool]:
    """Return all running processes, and whether they descend from the command.

    Daemons outlive their parents, and some processes overwrite their variables with a title, so a
    process descends from it as soon as its parent does or it carries the mark, and from then on.
    """
    verdicts: dict[psutil.Process, bool] = {}
    member_ids = {process.pid for process, is_member in known.items() if is_member}
    for process in psutil.process_iter():  # parents come before their children
        if process in known:
            verdicts[process] = known[process]
        else:
            verdicts[process] = _descends(process, mark, member_ids)
        if verdicts[process]:
            member_ids.add(process.pid)
    return verdicts


def _descends(process: psutil.Process, mark: str, member_ids: set[int]) -> bool:
    with suppress(psutil.Error):
        return process.ppid() in member_ids or process.environ().get(MARK) == mark
    return False


def _resident_bytes(process: psutil.Process) -> int:
    """Return the memory of a process; a page shared by several counts proportionally."""
    with suppress(psutil.Error):
        memory = process.memory_full_info()
        return int(getattr(memory, "pss", memory.rss))
    return 0
