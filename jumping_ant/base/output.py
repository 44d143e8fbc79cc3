"""Standard output and error, in commands for which they are no reason to stop."""

import io
import os
import sys
from contextlib import suppress
from typing import Any, TextIO


class _Tolerant(io.FileIO):
    """A file that drops what it cannot take."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or len(data)
        except OSError:
            return len(data)


def tolerate_failures() -> None:
    """Ignore failing writes to standard output and error: closed, full, or read by nobody.

    What a command prints is progress and advice; its results are files.
    """
    for descriptor in range(3):  # else the next file opened would take the place of a closed one
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    sys.stdout = _tolerant(sys.stdout, 1)
    sys.stderr = _tolerant(sys.stderr, 2)


def _tolerant(stream: TextIO | None, descriptor: int) -> TextIO:
    """Return a stream to the same file that ignores failures; None stands for a closed one."""
    if stream is not None:
        with suppress(OSError):
            stream.flush()
    return io.TextIOWrapper(
        io.BufferedWriter(_Tolerant(descriptor, "w", closefd=False)),
        encoding=stream.encoding if stream else "utf-8",
        errors="backslashreplace",
        line_buffering=True,
    )
