"""Measure all rows, or those named, for results.json and README.md.

Usage: python -m benchmarks [NAME...]
"""

import importlib
import sys
from collections.abc import Collection, Iterator

import psutil  # type: ignore[import-untyped]

from benchmarks import report
from benchmarks.measure import Row
from jumping_ant.base import command_line

# Modules are imported when needed: some take seconds.
ROWS = {
    "vector_env_vs_mj_step": "simulation",
    "vector_env_vs_async_gymnasium": "simulation",
    "vector_env_vs_envpool": "simulation",
    "pgpe_vs_gymne": "evolution",
    "dqn_vs_sb3": "off_policy",
    "sac_vs_sb3": "off_policy",
    "dqn_vs_sbx": "off_policy",
    "sac_vs_sbx": "off_policy",
    "article_four_seeds_vs_script": "four_seeds",
    "render_vs_record_video": "rendering",
    "checkpoint_overhead": "checkpoint",
}
PIPELINE_ROWS = ("tracking_overhead", "peak_memory", "noop_repro")  # measured in one copy of it
ROW_NAMES = (*ROWS, *PIPELINE_ROWS)
MOST_BUSY = 20.0  # [%] largest load of all cores before a row that gives reliable figures


def main() -> None:
    """Measure, and write the results after every row."""
    parser = command_line.parser(__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(ROW_NAMES))
    names = parser.parse_args().names or ROW_NAMES
    if unknown := set(names) - set(ROW_NAMES):
        parser.error(f"given {sorted(unknown)}, allowed: {', '.join(ROW_NAMES)}")
    results = report.load()
    for row in measure(names):
        print(
            f"{row.name:30} {report.shown(row.ours):>8} {report.shown(row.peer):>8} "
            f"{row.unit:14} ratio {row.ratio:.2f}, spread {row.spread:.0%}",
            flush=True,
        )
        results = report.with_row(results, row, ROW_NAMES)
        report.save(results)


def measure(names: Collection[str]) -> Iterator[Row]:
    """Measure the named rows, in a fixed order."""
    for name, module in ROWS.items():
        if name in names:
            warn_if_busy(name)
            yield getattr(importlib.import_module(f"benchmarks.{module}"), name)()
    if any(name in names for name in PIPELINE_ROWS):
        warn_if_busy(", ".join(PIPELINE_ROWS))
        rows = importlib.import_module("benchmarks.pipeline").rows()
        yield from (row for row in rows if row.name in names)


def warn_if_busy(rows: str) -> None:
    """Warn if something else uses the cores: it slows peers with many threads the most."""
    busy = psutil.cpu_percent(interval=1.0)
    if busy > MOST_BUSY:
        print(
            f"warning: {rows}: the machine is {busy:.0f} % busy with something else; "
            "measure again when it is idle",
            file=sys.stderr,
        )


if __name__ == "__main__":
    main()
