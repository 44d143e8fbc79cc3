"""What commands do first: parse arguments, switch telemetry off, and collect garbage rarely."""

import argparse
import atexit
import gc
import os

# Users who set these in the environment keep their values. (Rerun's library reports nothing.)
TELEMETRY = {
    "DVC_NO_ANALYTICS": "true",
    "ITERATIVE_DO_NOT_TRACK": "true",
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "RAY_USAGE_STATS_ENABLED": "0",
}


def parser(docstring: str | None, name: str | None = None) -> argparse.ArgumentParser:
    """Return a parser whose help has a docstring's first line (`-OO` drops docstrings)."""
    return argparse.ArgumentParser(prog=name, description=(docstring or "").partition("\n")[0])


def switch_off_telemetry() -> None:
    """Switch telemetry off in this process and its children, before the tools are imported."""
    for name, value in TELEMETRY.items():
        os.environ.setdefault(name, value)


def collect_garbage_rarely() -> None:
    """Let this process look for garbage rarely, and not at its exit.

    Importing torch or MLflow creates several hundred thousand objects and no garbage; looking
    through them takes a third of the CPU time of such a command.
    """
    gc.set_threshold(100_000)  # objects created and not freed between collections; usually 700
    atexit.register(gc.freeze)  # the collection at the exit leaves out what is frozen
