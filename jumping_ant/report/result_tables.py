"""The report's tables of outcomes, as text."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from jumping_ant.comparison import comparison
from jumping_ant.comparison.results import AgentResults
from jumping_ant.evaluation.measures import MEASURES, TERM
from jumping_ant.media import style
from jumping_ant.media.style import interval, number
from jumping_ant.report import charting

BEHAVIOUR = ("apex", "flight", "fluidity", "jumps")  # measures of how an agent jumps


@dataclass(frozen=True)
class Cell:
    """A number in a table, as text; `interval` is empty where there is none."""

    value: str = "\u2013"
    interval: str = ""
    is_best: bool = False


def table(
    results: Mapping[str, AgentResults], cells: Callable[[str], Sequence[Cell]]
) -> list[dict[str, Any]]:
    """Return a row for each agent, whose remark is its robot if that is not the edited one."""
    return [
        {
            "label": agent.label,
            "family": agent.family,
            "remark": style.remark(False, agent.block.robot),
            "cells": cells(name),
        }
        for name, agent in results.items()
    ]


def returns(
    results: Mapping[str, AgentResults], summary: Mapping[str, Any], confidence: float
) -> list[dict[str, Any]]:
    """Return each agent's returns: of published and final policies, and after equal control steps.

    `summary` is `agents` of `results/comparison.json`.
    """

    def cells(name: str) -> list[Cell]:
        agent, final = summary[name], results[name].variants.get("final")
        described = comparison.describe(final["return"], confidence) if final else None
        columns = [
            _cell(results, summary, name, "return"),
            Cell(number(agent["return"]["mean"])),
            Cell(number(agent["return"]["worst"])),
            estimate(described, agent["seeds"]),
        ]
        early = estimate(agent.get("return_at_equal_steps"), agent["seeds"])
        return [*columns, early] if charting.learners(results) else columns

    return table(results, cells)


def behaviour(
    results: Mapping[str, AgentResults], summary: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Return how each agent jumps, and what its training cost."""

    def cells(name: str) -> list[Cell]:
        columns = [_cell(results, summary, name, measure) for measure in BEHAVIOUR]
        steps = Cell(number(summary[name]["env_steps"]))  # follow from params.yaml: none is best
        return [*columns, steps]

    return table(results, cells)


def terms(
    results: Mapping[str, AgentResults], summary: Mapping[str, Any]
) -> tuple[list[str], list[dict[str, Any]]]:
    """Return the terms of the reward, none for a single one, and what each adds to the returns."""
    first = next(iter(results.values())).quantities
    names = [name for name in first if name.startswith(TERM)]
    rows = table(
        results,
        lambda name: [estimate(summary[name][term], summary[name]["seeds"]) for term in names],
    )
    return [name.removeprefix(TERM).replace("_", " ") for name in names], rows


def estimate(entry: Mapping[str, float] | None, num_seeds: int, is_best: bool = False) -> Cell:
    """Return a number with its interval; a dash for none."""
    if entry is None:
        return Cell()
    ends = interval(entry["low"], entry["high"], num_seeds)
    return Cell(number(entry["iqm"]), ends, is_best)


def _cell(
    results: Mapping[str, AgentResults], summary: Mapping[str, Any], name: str, measure: str
) -> Cell:
    """Return an agent's cell of a measure, marked if no agent that learns does better."""
    direction = MEASURES[measure].is_better
    scores = {
        learner: direction * summary[learner][measure]["iqm"]
        for learner in charting.learners(results)
        if direction and measure in summary[learner]
    }
    is_best = name in scores and scores[name] == max(scores.values())
    return estimate(summary[name].get(measure), summary[name]["seeds"], is_best)
