"""What runs and models are about, as Markdown for MLflow's pages."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from jumping_ant.wording import estimate, number

LONGEST = 7500  # characters; MLflow keeps 8000 and would cut the rest off
HARD_SPACE = "\u00a0"
QUANTITIES = {
    "return": "return",
    "peak_height": "peak height [m]",
    "smoothness": "torque change",
    "train_seconds": "training [s]",
}
"""Columns of the table of results: their keys in `results/comparison.json`, and headings."""


def comparison(results: Mapping[str, Any]) -> str:
    """Return the results of a comparison: a table, then the claims; as much as MLflow keeps.

    Args:
        results: The content of `results/comparison.json`; whatever is missing is left out.
    """
    text = ""
    for line in [*_table(results.get("agents", {})), *_claims(results.get("claims", []))]:
        if len(text) + len(line) > LONGEST:
            return f"{text}\n(The rest is in `comparison.json`.)\n"
        text += line + "\n"
    return text


def policy(
    algorithm: str, seed: int, means: Mapping[str, float], origins: Mapping[str, str]
) -> str:
    """Return what a policy is, how good, and where it comes from.

    Args:
        algorithm: What trained it.
        seed: The training seed.
        means: Means over the evaluation episodes, empty if there was no evaluation.
        origins: What it can be traced back to, by what that is.
    """
    known = [
        f"{words} {number(means[name])}{unit}"
        for name, words, unit in (
            ("return", "mean evaluation return", ""),
            ("peak_height", "mean peak height", " m"),
        )
        if name in means
    ]
    result = ", ".join(known) or "not evaluated"
    lines = [f"{algorithm}, training seed {seed}: {result}.", ""]
    return "\n".join(lines + [f"- {what}: `{value}`" for what, value in origins.items()])


def _table(agents: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    if not agents:
        return
    yield _row("agent", *QUANTITIES.values())
    yield "|---" * (len(QUANTITIES) + 1) + "|"
    for agent, entry in sorted(agents.items(), key=_return, reverse=True):
        yield _row(agent, *(_cell(entry.get(key), entry["seeds"]) for key in QUANTITIES))
    yield ""
    yield "Interquartile means over seeds, in brackets their confidence intervals; times are means."
    yield ""


def _return(agent: tuple[str, Mapping[str, Any]]) -> float:
    """Return what to sort by: the best lead, as MLflow folds a description after some lines."""
    return float(agent[1].get("return", {}).get("iqm", -math.inf))


def _row(*cells: str) -> str:
    """Return a row of the table, its cells apart and on one line each, as MLflow has them not."""
    return "| " + " | ".join(f"{cell}  ".replace(" ", HARD_SPACE) for cell in cells) + " |"


def _cell(value: Any, num_seeds: int) -> str:
    if isinstance(value, Mapping):
        return estimate(value["iqm"], value["low"], value["high"], num_seeds)
    return "–" if value is None else number(value)


def _claims(claims: Sequence[Mapping[str, str]]) -> Iterator[str]:
    for claim in claims:
        yield f"- **{claim['verdict']}**: {claim['text']} ({claim['evidence']})"
