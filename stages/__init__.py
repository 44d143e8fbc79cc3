"""The stages of `dvc.yaml`, one thin script each; a stage never imports a stage."""

import os
import sys
from collections.abc import Callable

# Nothing phones home; whoever wants to be counted sets these.
os.environ.setdefault("DVC_NO_ANALYTICS", "true")
os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")

from jumping_ant.errors import InputError  # noqa: E402  (telemetry is off before any import)


def run(main: Callable[[], None]) -> None:
    """Run a stage's `main`; a mistake in its input ends in one clear line and exit status 2."""
    try:
        main()
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
