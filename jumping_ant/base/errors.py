"""Exceptions that end a command with a one-line message and an exit status."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

NO_THREAD = "can't start new thread"  # Python's words for a limit of the system
LONGEST = 300  # characters of another library's message: zipfile and NumPy quote what they read


class InputError(ValueError):
    """Bad input: the message says what was given, what is allowed and where."""


class WorkerError(Exception):
    """A required worker process keeps dying or does not start; the message says so."""


class StoppedError(Exception):
    """A stop was requested: the message says what is kept and how to resume."""


def told(error: BaseException) -> str:
    """Return an exception of another library as a part of a line: its type, and what it says."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:LONGEST]


def printable(text: str) -> str:
    """Return a text with escapes for what a terminal would obey, or show at another place."""
    return "".join(
        each if each.isprintable() or each == "\n" else each.encode("unicode_escape").decode()
        for each in text
    )


@contextmanager
def reported() -> Iterator[None]:
    """Print an exception of this module or of the system, and exit (2, 1, or 130 as shells do)."""
    try:
        yield
    except InputError as error:
        _exit(f"error: {error}", 2)
    except WorkerError as error:
        _exit(f"error: {error}", 1)
    except StoppedError as error:
        _exit(f"stopped: {error}", 130)
    except (OSError, MemoryError, RuntimeError) as error:
        if isinstance(error, RuntimeError) and str(error) != NO_THREAD:
            raise
        _exit(f"error: {str(error) or 'out of memory'}; run it again once that is mended", 1)


def _exit(line: str, status: int) -> NoReturn:
    print(printable(line), file=sys.stderr)
    sys.exit(status)
