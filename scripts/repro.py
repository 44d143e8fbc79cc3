"""Run the pipeline: list what DVC will run, with the seconds of the last time, then run it.

Usage: python -m scripts.repro [STAGE ...] (`make repro`)
"""

import re
import subprocess
import sys
from contextlib import suppress
from typing import Any

from jumping_ant.base import command_line, output
from jumping_ant.base.errors import InputError, reported
from jumping_ant.base.files import read_json
from jumping_ant.base.paths import Paths
from jumping_ant.params import params_file
from scripts import checkout


def main() -> None:
    """Run the first stages, which mostly write the same as before, then what is left to run."""
    parser = command_line.parser(__doc__)
    parser.add_argument("targets", nargs="*", help="stages to run, with those that they need")
    targets = parser.parse_args().targets
    params_file.load()  # stops at a mistake in them
    checkout.git("rev-parse", "--git-dir")  # DVC needs a repository, and says less of what it lacks
    checkout.warn_of_no_name()
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
    """List stages with the seconds that each noted last, and run DVC; exit as it if it fails."""
    from dvc.cli import main as dvc  # type: ignore[import-untyped]

    last: dict[str, Any] = {}
    with suppress(InputError):  # a hint: none, or a damaged one
        last = read_json(Paths().seconds, "")
    listed = {it: last[it] if isinstance(last.get(it), int | float) else 0 for it in stages}
    print("To run, if inputs have changed by then, with the seconds of the last time:")
    for name, seconds in [*listed.items(), ("sum", sum(listed.values()))]:
        print(f"  {name:36}{f'{seconds:.0f}' if seconds else '-':>8}")
    if status := int(dvc(["repro", *targets])):
        sys.exit(status)


if __name__ == "__main__":
    output.tolerate_failures()
    with reported():
        main()
