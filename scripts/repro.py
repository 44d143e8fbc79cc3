"""Run the pipeline: list what DVC will run, with the seconds of the last time, then run it.

Usage: python -m scripts.repro [STAGE ...] (`make repro`)
"""

import json
import re
import subprocess
import sys
import threading
import time
from contextlib import suppress
from itertools import pairwise

import psutil  # type: ignore[import-untyped]

from jumping_ant.base import command_line, output, telemetry
from jumping_ant.base.errors import reported
from jumping_ant.base.files import PROJECT_ROOT, write_json
from jumping_ant.params import params_file
from scripts import checkout

PATH = PROJECT_ROOT / ".dvc" / "tmp" / "seconds.json"


def main() -> None:
    """Run the first stages, which mostly write the same as before, then what is left to run."""
    parser = command_line.parser(__doc__)
    parser.add_argument("targets", nargs="*", help="stages to run, with those that they need")
    targets = parser.parse_args().targets
    params_file.load()  # stops at a mistake in them
    checkout.git("rev-parse", "--git-dir")  # DVC needs a repository, and says less of what it lacks
    checkout.warn_of_no_name()
    telemetry.switch_off()
    stages = planned(targets)
    first = [stage for stage in stages if stage in ("digest", "check", "build")]
    if first and first != stages:
        run(["build"], first)
        stages = planned(targets)
    if stages:
        run(targets, stages)
    else:
        print("Data and pipelines are up to date.")


def planned(targets: list[str]) -> list[str]:
    """Return the stages that DVC would run if each wrote something new; exit as DVC if it fails."""
    dry = [sys.executable, "-m", "dvc", "repro", "--dry", "--force-downstream", *targets]
    done = subprocess.run(dry, stdout=subprocess.PIPE, encoding="utf-8")
    if done.returncode:
        sys.exit(done.returncode)
    return re.findall(r"^(?:Running s|S)tage '(.+)'(?::$| is cached)", done.stdout, re.MULTILINE)


def run(targets: list[str], stages: list[str]) -> None:
    """List stages, run DVC, and keep the seconds of each stage; exit as DVC if it fails."""
    from dvc.cli import main as dvc  # type: ignore[import-untyped]

    last = json.loads(PATH.read_text(encoding="utf-8")) if PATH.exists() else {}
    listed = {stage: last.get(stage, 0) for stage in stages}
    print("To run, if inputs have changed by then, with the seconds of the last time:")
    for name, seconds in [*listed.items(), ("sum", sum(listed.values()))]:
        print(f"  {name:36}{f'{seconds:.0f}' if seconds else '-':>8}")
    begun: dict[str, float] = {}
    has_ended = threading.Event()
    threading.Thread(target=watch, args=(begun, has_ended), daemon=True).start()
    status = int(dvc(["repro", *targets]))
    has_ended.set()
    times = [*begun.values(), *([] if status else [time.monotonic()])]  # the last one may fail
    took = [round(end - start, 1) for start, end in pairwise(times)]
    with suppress(OSError):
        write_json(PATH, last | dict(zip(begun, took, strict=False)))
    if status:
        sys.exit(status)


def watch(begun: dict[str, float], has_ended: threading.Event) -> None:
    """Note when stages begin; DVC names each to its command, a child of this process."""
    while not has_ended.wait(0.2):
        for child in psutil.Process().children():
            with suppress(psutil.Error):  # it has ended since
                if stage := child.environ().get("DVC_STAGE"):
                    begun.setdefault(stage, time.monotonic())


if __name__ == "__main__":
    output.tolerate_failures()
    with reported():
        main()
