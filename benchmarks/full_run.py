"""Record the cost of a pipeline run: the time of each stage, and the memory.

Usage:  python -m benchmarks.full_run [COMMAND...]   (by default: dvc repro --force)
Writes: benchmarks/full_run.json

Seeds that are trained already are not trained again: remove `.checkpoints/` first.
"""

import re
import sys
from pathlib import Path
from typing import Any

from benchmarks.watch import Usage, watch
from jumping_ant.base.files import PROJECT_ROOT, write_json
from scripts.checkout import with_tools

PATH = Path(__file__).parent / "full_run.json"
COMMAND = ["dvc", "repro", "--force"]
STAGE_LINE = re.compile(r"Running stage '(.+)':")  # printed by DVC when a stage begins


def main() -> None:
    """Run the command and write what it took."""
    usage = watch(sys.argv[1:] or COMMAND, PROJECT_ROOT, with_tools(), is_shown=True)
    write_json(PATH, summarize(usage))


def summarize(usage: Usage) -> dict[str, Any]:
    """Return the content of `full_run.json`; a stage lasts until the next begins."""
    begun = [
        (seconds, match[1])
        for seconds, line in usage.lines
        if (match := STAGE_LINE.fullmatch(line))
    ]
    ends = [*(seconds for seconds, _ in begun), usage.seconds][1:]
    stages = {
        stage: round(end - seconds, 1) for (seconds, stage), end in zip(begun, ends, strict=True)
    }
    at_peak = [stage for seconds, stage in begun if seconds <= usage.peak_seconds]
    return {
        "stages": stages,
        "seconds": round(usage.seconds, 1),
        "peak_memory_gib": round(usage.peak_memory, 2),
        "peak_stage": at_peak[-1] if at_peak else None,
    }


if __name__ == "__main__":
    main()
