"""Garbage collection in commands that spend most of their time on imports.

The import of torch or MLflow creates several hundred thousand objects, and no garbage. By default,
Python's collector walks through them again and again, and once more at the exit: a third of the CPU
time of such a command.
"""

import atexit
import gc

THRESHOLD = 100_000  # objects created and not yet freed between collections; Python's own is 700


def collect_rarely() -> None:
    """Let this process look for garbage rarely, and not at its exit."""
    gc.set_threshold(THRESHOLD)
    atexit.register(gc.freeze)  # the collection at the exit leaves out what is frozen
