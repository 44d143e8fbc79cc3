"""The report's claims, as text, grouped by the article's statement that they test."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from jumping_ant.comparison.claims.statements import STATEMENTS
from jumping_ant.looks.style import capitalized, estimate, number, p_value

SIGNS = {"supported": "\u2713", "refuted": "\u2717", "equivalent": "\u2248", "inconclusive": "?"}
SCEPTIC = "A sceptic's questions"  # claims that test no statement of the article


@dataclass(frozen=True)
class Statement:
    """A statement and its claims."""

    title: str
    counts: Mapping[str, int]  # number of claims by verdict
    claims: Sequence[Mapping[str, Any]]  # in words, each with its `index` among all claims


def read(entries: Sequence[Mapping[str, Any]], num_seeds: int) -> list[Statement]:
    """Return the statements that were tested, in the article's order, those of sceptics last."""
    tested = {entry["statement"] for entry in entries}
    return [
        Statement(
            f"{number}. {STATEMENTS[number]}" if number else SCEPTIC,
            count([entry for entry in entries if entry["statement"] == number]),
            [
                _in_words(index, entry, num_seeds)
                for index, entry in enumerate(entries)
                if entry["statement"] == number
            ],
        )
        for number in sorted(tested, key=lambda number: number or math.inf)
    ]


def count(entries: Sequence[Mapping[str, Any]]) -> dict[str, int]:
    """Return the number of claims with each verdict that occurs."""
    verdicts = [entry["verdict"] for entry in entries]
    return {verdict: verdicts.count(verdict) for verdict in SIGNS if verdict in verdicts}


def _in_words(index: int, entry: Mapping[str, Any], num_seeds: int) -> dict[str, Any]:
    return {
        "index": index,
        "verdict": entry["verdict"],
        "text": entry["text"],
        "effect": _effect(entry["effect"], num_seeds),
        "p": _p_values(_null(entry["no_effect"]), entry["p"], entry["p_adjusted"]),
        "margin": _margin(entry),
        "evidence": entry["evidence"],
    }


def _effect(effect: Mapping[str, Any], num_seeds: int) -> str:
    name = capitalized(effect["name"])
    if effect["value"] is None:
        return f"{name}: no seed has a value that can be compared"
    return f"{name}: {estimate(effect['value'], effect['low'], effect['high'], num_seeds)}"


def _null(no_effect: float) -> str:
    """Return the hypothesis that the effect is none, or that of a claim of not being worse."""
    return f"a difference of {number(no_effect)}" if no_effect < 0 else "no difference"


def _margin(entry: Mapping[str, Any]) -> str:
    """Return what is said of a difference outside of the margin; empty for a claim without one."""
    if entry["margin"] is None:
        return ""
    low, high = (number(entry["margin"][end]) for end in ("low", "high"))
    p_values = entry["p_equivalence"], entry["p_equivalence_adjusted"]
    return _p_values(f"a difference outside of {low} to {high}", *p_values)


def _p_values(hypothesis: str, p: float, adjusted: float) -> str:
    return f"{hypothesis}: p = {p_value(p)}, adjusted {p_value(adjusted)}"
