"""Run the pipeline: tell what it will cost, run it, and tell what it took.

Usage: python -m scripts.repro (`make repro`)

What each stage takes is kept in `.cost.json`, for the next estimate.
"""

import os
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass

import psutil  # type: ignore[import-untyped]

from jumping_ant.base import command_line, machine, output, telemetry
from jumping_ant.base.errors import reported
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.experiment import params_file
from scripts import checkout, cost, rates

SECONDS_BETWEEN_LOOKS = 0.5


@dataclass(frozen=True)
class Begun:
    """A stage's begin: the time, and the core-seconds so far."""

    stage: str
    time: float
    core_seconds: float


class Watch(threading.Thread):
    """Notes when stages begin: DVC tells each command its stage, in the environment."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self._begun: list[Begun] = []
        self._known: set[psutil.Process] = set()
        self._has_ended = threading.Event()

    def run(self) -> None:
        """Look at this process's children until the end."""
        while not self._has_ended.wait(SECONDS_BETWEEN_LOOKS):
            for child in set(psutil.Process().children()) - self._known:
                with suppress(psutil.Error):  # it has ended since
                    if stage := child.environ().get("DVC_STAGE"):
                        self._known.add(child)
                        self._begun.append(Begun(stage, child.create_time(), _core_seconds()))

    def end(self) -> list[cost.Ran]:
        """Return what each stage took; one lasts until the next begins."""
        self._has_ended.set()
        self.join()
        ends = [*self._begun[1:], Begun("", time.time(), _core_seconds())]
        return [
            cost.Ran(one.stage, after.time - one.time, after.core_seconds - one.core_seconds)
            for one, after in zip(self._begun, ends, strict=False)
        ]


def _core_seconds() -> float:
    """Return the CPU time of this process and of all that have ended below it."""
    return sum(os.times()[:4])


def main() -> int:
    """Estimate, run, compare; return DVC's exit status.

    Raises:
        WorkerError: One of the first stages failed or was stopped, which the estimate runs.
    """
    parser = command_line.parser(__doc__)
    parser.add_argument("targets", nargs="*", help="stages to run, with those that they need")
    targets = parser.parse_args().targets
    params = params_file.load()
    checkout.git("rev-parse", "--git-dir")  # DVC needs a repository, and says less of what it lacks
    checkout.warn_of_no_name()
    telemetry.switch_off()
    from dvc.cli import main as dvc  # type: ignore[import-untyped]
    from dvc.exceptions import DvcException  # type: ignore[import-untyped]

    own, found = rates.Rates(), None
    with suppress(DvcException):  # `dvc repro` fails, too, and says why
        found = cost.estimate(PROJECT_ROOT, PROJECT_ROOT, params, own, targets)
    if found and not found.costs:
        print("Data and pipelines are up to date.")
        return 0
    if found:
        print(f"To run: {cost.summary(one.stage for one in found.costs)}")
        print(
            f"Estimate: {found.total}, on {machine.num_cores()} cores. {found.whose}\n", flush=True
        )
    watch = Watch()
    watch.start()
    status = int(dvc(["repro", *targets]))
    ran = watch.end() if status == 0 else watch.end()[:-1]  # the last one has failed
    if found and ran:
        print(found.compared(ran))
        own.keep(found.told_by(ran))
    return status


if __name__ == "__main__":
    output.tolerate_failures()
    with reported():
        sys.exit(main())
