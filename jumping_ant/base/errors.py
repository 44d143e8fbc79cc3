"""Exceptions that end a command with a one-line message and an exit status."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager

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


@contextmanager
def reported() -> Iterator[None]:
    """Print an exception of this module as one line, and exit (2, 1, or 130 as shells do)."""
    try:
        yield
    except (InputError, WorkerError) as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2 if isinstance(error, InputError) else 1)
    except StoppedError as error:
        print(f"stopped: {error}", file=sys.stderr)
        sys.exit(130)
