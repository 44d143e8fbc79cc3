"""Samples of the machine's load, under MLflow's own metric names.

MLflow's own monitor uses a thread for each run and a call for each sample. This keeps samples until
they are logged together with other metrics.
"""

import time
from dataclasses import dataclass

import psutil  # type: ignore[import-untyped]
from mlflow.entities import Metric

from jumping_ant.tracking.records import SYSTEM
from jumping_ant.tracking.store import now_ms

SAMPLE_SECONDS = 10.0


@dataclass(frozen=True)
class Sample:
    """The load at a time [ms since 1970]: values by the name of their metric."""

    time: int
    values: dict[str, float]

    def metrics(self, start: int) -> list[Metric]:
        """Return it as MLflow's metrics; the step is the seconds since a run's start [ms]."""
        step = max(0, self.time - start) // 1000
        return [
            Metric(SYSTEM + name, value, self.time, step) for name, value in self.values.items()
        ]


class MachineLoad:
    """Samples the load of processors and memory every few seconds."""

    def __init__(self) -> None:
        self.samples: list[Sample] = []
        self._begin_interval()

    def update(self) -> None:
        """Take a sample if one is due."""
        if time.monotonic() >= self._due:
            self.samples.append(_sample())
            self._begin_interval()

    def _begin_interval(self) -> None:
        psutil.cpu_percent()  # a sample is the mean since this call
        self._due = time.monotonic() + SAMPLE_SECONDS


def _sample() -> Sample:
    memory = psutil.virtual_memory()
    values = {
        "cpu_utilization_percentage": psutil.cpu_percent(),
        "system_memory_usage_megabytes": memory.used / 1e6,
        "system_memory_usage_percentage": 100 * memory.used / memory.total,
    }
    return Sample(now_ms(), values)
