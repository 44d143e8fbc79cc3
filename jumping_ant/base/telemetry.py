"""Switches that turn off the telemetry of the tools used."""

import os

# Set these in the environment to re-enable telemetry. (Rerun's switch is in its own settings; its
# library reports nothing by itself.)
SWITCHES = {
    "DVC_NO_ANALYTICS": "true",
    "ITERATIVE_DO_NOT_TRACK": "true",
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "RAY_USAGE_STATS_ENABLED": "0",
}


def switch_off() -> None:
    """Switch telemetry off in this process and its children, before the tools are imported."""
    for name, value in SWITCHES.items():
        os.environ.setdefault(name, value)
