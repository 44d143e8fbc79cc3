"""`results.json`, and the table of `README.md` that shows it."""

import importlib.metadata
import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.measure import CORES, Row
from jumping_ant.base.files import write_json, write_text
from jumping_ant.base.machine import processor
from scripts import markdown

RESULTS_PATH = Path(__file__).with_name("results.json")
README_PATH = Path(__file__).with_name("README.md")
PACKAGES = ["mujoco", "gymnasium", "numpy", "torch", "stable-baselines3", "sbx-rl", "jax"]
PACKAGES += ["evotorch", "ray", "envpool", "moviepy", "mlflow", "dvc"]

Results = dict[str, Any]


def load() -> Results:
    """Return the results measured on this machine with these versions, if any."""
    fresh: Results = {"rows": [], "machine": machine()}
    if not RESULTS_PATH.exists():
        return fresh
    stored: Results = json.loads(RESULTS_PATH.read_text(encoding="utf-8"))
    return stored if stored["machine"] == fresh["machine"] else fresh


def save(results: Results) -> None:
    """Write the results, and update the README's table."""
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
    """Return results with a row, rounded, added or replaced, in the order of the names."""
    rounded = {
        key: float(f"{value:.4g}") if isinstance(value, float) else value
        for key, value in asdict(row).items()
    }
    rows = {old["name"]: old for old in results["rows"]} | {row.name: rounded}
    return results | {"rows": [rows[name] for name in names if name in rows]}


def fill(text: str, results: Results) -> str:
    """Return a page with its table filled from results, between two markers."""
    computer = results["machine"]
    versions = ", ".join(f"{name} {version}" for name, version in computer["versions"].items())
    rows = []
    for row in results["rows"]:
        ours, peer = shown(row["ours"]), shown(row["peer"])
        ratio, spread = f"**{row['ratio']:.2f}**", f"{row['spread']:.0%}"
        rows.append([f"`{row['name']}`", ours, peer, row["unit"], ratio, spread])
    table = markdown.table(("row", "ours", "peer", "unit", "ratio", "spread"), rows)
    head = f"On {computer['cores']} cores of {computer['cpu']}, with {versions}:\n\n"
    return markdown.replaced(README_PATH, text, "rows", head + table)


def shown(value: float) -> str:
    """Format a figure with three digits, or with all digits before the decimal point."""
    return f"{value:,.0f}" if value >= 100 or value == 0 else f"{value:.3g}"
