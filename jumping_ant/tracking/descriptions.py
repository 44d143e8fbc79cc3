"""Descriptions of runs and models, as Markdown for MLflow's pages."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

from jumping_ant.comparison.results import deciding_p
from jumping_ant.media.style import estimate, number, p_value

LONGEST = 7500  # characters; MLflow keeps 8000 and would cut the rest off
MISSING = "–"
HARD_SPACE = "\u00a0"
QUANTITIES = {
    "survivors_return": "return without a fall",
    "falls_per_1000_jumps": "falls per 1,000 jumps",
    "apex": "apex [m]",
    "flight": "flight",
    "fluidity": "fluidity",
}
"""Columns of the results table besides the return: keys of an agent, and headings."""


def comparison(results: Mapping[str, Any]) -> str:
    """Return what a summary holds: a table, then the claims; as much as MLflow keeps."""
    text = ""
    for line in [*agent_table(results.get("agents", {})), *map(_claim, results.get("claims", []))]:
        if len(text) + len(line) > LONGEST:
            return f"{text}\n(The rest is in `comparison.json` and `speed.json`.)\n"
        text += line + "\n"
    return text


def policy(
    algorithm: str, seed: int, hold: int, means: Mapping[str, float], origins: Mapping[str, str]
) -> str:
    """Describe a policy: what it is, how good it is, and where it comes from.

    `hold` counts control steps. `means` are over the held-out episodes, and `validation_return`;
    `origins` lead back to code and files, by label.
    """
    known = [
        f"{words} {number(means[name])}{unit}".lstrip()
        for name, words, unit in (
            ("return", "mean return", " on the held-out episodes"),
            ("validation_return", "", " in validation"),
            ("apex", "apex of its jumps", " m"),
            ("flight", "share of time in flight", ""),
        )
        if name in means
    ]
    result = ", ".join(known) or "not evaluated"
    steps = "1 control step" if hold == 1 else f"{hold} control steps"
    lines = [f"{algorithm}, training seed {seed}: {result}. Each output is held for {steps}.", ""]
    return "\n".join(lines + [f"- {what}: `{value}`" for what, value in origins.items()])


def agent_table(agents: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Yield the lines of a table of a summary's `agents` (`results.merged`)."""
    if not agents:
        return
    shown = {
        key: heading
        for key, heading in QUANTITIES.items()
        if any(key in entry for entry in agents.values())
    }
    has_failed = ["failed"] if any("failed" in entry for entry in agents.values()) else []
    words = [f"{it} seeds" for it in has_failed]
    headings = ("agent", "return", "mean", "worst seed", *words, *shown.values(), "training [s]")
    yield _row(*headings)
    yield "|---" * len(headings) + "|"
    best = {name: -entry.get("return", {}).get("iqm", -math.inf) for name, entry in agents.items()}
    for agent in sorted(agents, key=best.__getitem__):  # MLflow folds a long description
        entry = agents[agent]
        returns = entry.get("return", {})
        yield _row(
            agent,
            _estimate(returns, entry["seeds"]),
            *(_number(returns.get(key)) for key in ("mean", "worst")),
            *(_number(entry.get(key)) for key in has_failed),
            *(_estimate(entry.get(key, {}), entry["seeds"]) for key in shown),
            _number(entry.get("train_seconds")),
        )
    yield ""
    yield (
        "Interquartile means over seeds, in brackets their intervals (Student's t on the exact "
        "bootstrap standard error); mean, worst seed and time are of all seeds."
    )
    yield ""


def _row(*cells: str) -> str:
    """Return a row of the table; hard spaces pad its cells and keep each on one line."""
    return "| " + " | ".join(f"{cell}  ".replace(" ", HARD_SPACE) for cell in cells) + " |"


def _estimate(entry: Mapping[str, float], num_seeds: int) -> str:
    return estimate(entry["iqm"], entry["low"], entry["high"], num_seeds) if entry else MISSING


def _claim(claim: Mapping[str, Any]) -> str:
    p = p_value(deciding_p(claim))
    return f"- **{claim['verdict']}** (adjusted p = {p}): {claim['text']}"


def _number(value: float | None) -> str:
    return MISSING if value is None else number(value)
