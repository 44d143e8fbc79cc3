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
    """Run a command and watch it.

    Args:
        command: What to run.
        folder: Where to run it.
        environment: Its environment variables.
        is_shown: Whether its output is shown as well.

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
    family = _Family(mark)
    while not has_ended.wait(SECONDS_BETWEEN_SAMPLES):
        seconds = time.perf_counter() - started
        memory = sum(map(_resident_bytes, family.members())) / 2**30
        if memory > usage.peak_memory:
            usage.peak_memory, usage.peak_seconds = memory, seconds


class _Family:
    """All descendants of a command.

    Daemons outlive their parents, and some processes overwrite their variables with a title, so a
    process belongs here as soon as its parent does or it carries the mark, and from then on.
    """

    def __init__(self, mark: str) -> None:
        self._mark = mark
        self._verdicts: dict[psutil.Process, bool] = {}

    def members(self) -> list[psutil.Process]:
        """Return those that are running."""
        verdicts: dict[psutil.Process, bool] = {}
        own_ids = {process.pid for process, is_own in self._verdicts.items() if is_own}
        for process in psutil.process_iter():  # parents come before their children
            if process in self._verdicts:
                verdicts[process] = self._verdicts[process]
            else:
                verdicts[process] = self._is_own(process, own_ids)
            if verdicts[process]:
                own_ids.add(process.pid)
        self._verdicts = verdicts
        return [process for process, is_own in verdicts.items() if is_own]

    def _is_own(self, process: psutil.Process, own_ids: set[int]) -> bool:
        with suppress(psutil.Error):
            return process.ppid() in own_ids or process.environ().get(MARK) == self._mark
        return False


def _resident_bytes(process: psutil.Process) -> int:
    """Return the memory of a process; a page shared by several counts proportionally."""
    with suppress(psutil.Error):
        memory = process.memory_full_info()
        return int(getattr(memory, "pss", memory.rss))
    return 0
