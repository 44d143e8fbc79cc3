"""`results.json`, and the tables of `README.md` that show it."""

import importlib.metadata
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.measure import Row
from benchmarks.settings import CORES
from jumping_ant.base.files import write_json, write_text
from jumping_ant.base.machine import processor
from scripts import marks

RESULTS_PATH = Path(__file__).with_name("results.json")
README_PATH = Path(__file__).with_name("README.md")
PACKAGES = (
    "mujoco",
    "gymnasium",
    "numpy",
    "torch",
    "stable-baselines3",
    "sbx-rl",
    "jax",
    "evotorch",
    "ray",
    "envpool",
    "moviepy",
    "mlflow",
    "dvc",
)

Results = dict[str, Any]


def load() -> Results:
    """Return the results measured on this machine with these versions, if any."""
    fresh: Results = {"rows": [], "profiles": [], "scale": [], "machine": machine()}
    if not RESULTS_PATH.exists():
        return fresh
    stored: Results = json.loads(RESULTS_PATH.read_text(encoding="utf-8"))
    return stored if stored["machine"] == fresh["machine"] else fresh


def save(results: Results) -> None:
    """Write the results, and update the README's tables."""
    write_json(RESULTS_PATH, results)
    write_text(README_PATH, fill(README_PATH.read_text(encoding="utf-8"), results))


def machine() -> dict[str, Any]:
    """Return what figures depend on: the processor, its cores and the versions of packages."""
    return {
        "cores": CORES,
        "cpu": processor(),
        "versions": {name: importlib.metadata.version(name) for name in PACKAGES},
    }


def with_row(results: Results, row: Row, names: Iterable[str]) -> Results:
    """Return results with a row added, or replacing an older one.

    Args:
        results: All results.
        row: What was measured.
        names: Names of all rows, in their order.
    """
    rows = {old["name"]: old for old in results["rows"]} | {row.name: _rounded(asdict(row))}
    return results | {"rows": [rows[name] for name in names if name in rows]}


def with_table(results: Results, name: str, entries: Iterable[Any]) -> Results:
    """Return results with a further table added, or replacing an older one.

    Args:
        results: All results.
        name: Name of the table.
        entries: Its rows, which are dataclasses.
    """
    return results | {name: [_rounded(asdict(entry)) for entry in entries]}


def fill(text: str, results: Results) -> str:
    """Return a page with its tables filled from results, each between two markers."""
    tables = {"rows": _rows, "profiles": _profiles, "scale": _scale}
    for name, make in tables.items():
        text = marks.replaced(README_PATH, text, name, make(results))
    return text


def _rows(results: Results) -> str:
    computer = results["machine"]
    versions = ", ".join(f"{name} {version}" for name, version in computer["versions"].items())
    head = f"On {computer['cores']} cores of {computer['cpu']}, with {versions}:\n\n"
    return head + _table(
        ("row", "ours", "peer", "unit", "ratio", "spread"),
        [
            (
                f"`{row['name']}`",
                shown(row["ours"]),
                shown(row["peer"]),
                row["unit"],
                f"**{row['ratio']:.2f}**",
                f"{row['spread']:.0%}",
            )
            for row in results["rows"]
        ],
    )


def _profiles(results: Results) -> str:
    columns = ("total", "physics", "mj_step", "learning", "products")
    return _table(
        (
            "work",
            "all [µs]",
            "physics",
            "`mj_step` alone",
            "gradient steps",
            "matrix products",
        ),
        [
            (profile["work"], *(shown(profile[column]) for column in columns))
            for profile in results["profiles"]
        ],
    )


def _scale(results: Results) -> str:
    return _table(
        ("work", "size", "one thread [µs]", "all cores [µs]", "memory [MiB]"),
        [
            (
                cost["work"],
                shown(cost["size"]),
                shown(cost["microseconds_one_thread"]),
                shown(cost["microseconds_all_threads"]),
                shown(cost["mebibytes"]),
            )
            for cost in results["scale"]
        ],
    )


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def shown(value: float) -> str:
    """Format a figure with three digits, or with all digits before the decimal point."""
    return f"{value:,.0f}" if value >= 100 or value == 0 else f"{value:.3g}"


def _rounded(figures: dict[str, Any]) -> dict[str, Any]:
    """Round to four digits: the rest is noise."""
    return {
        key: float(f"{value:.4g}") if isinstance(value, float) else value
        for key, value in figures.items()
    }
