"""The report's tables of outcomes, as text."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from jumping_ant.comparison import comparison
from jumping_ant.evaluation.measures import MEASURES, TERM
from jumping_ant.media import style
from jumping_ant.media.style import interval, number
from jumping_ant.report.outcome import Outcome

BEHAVIOUR = ("apex", "flight", "fluidity", "jumps")  # measures of how an agent jumps


@dataclass(frozen=True)
class Cell:
    """A number in a table, as text; `interval` is empty where there is none."""

    value: str = "\u2013"
    interval: str = ""
    is_best: bool = False


def returns(outcome: Outcome) -> list[dict[str, Any]]:
    """Return the table of returns: of published and final policies, and after equal steps."""

    def cells(name: str) -> list[Cell]:
        agent, final = outcome.agents[name], outcome.results[name].variants.get("final")
        confidence = outcome.params.compare.confidence
        described = comparison.describe(final["return"], confidence) if final else None
        columns = [
            _cell(outcome, name, "return"),
            Cell(number(agent["return"]["mean"])),
            Cell(number(agent["return"]["worst"])),
            _estimate(described, agent["seeds"]),
        ]
        early = _estimate(agent.get("return_at_equal_steps"), agent["seeds"])
        return [*columns, early] if outcome.learners else columns

    return _table(outcome, cells)


def behaviour(outcome: Outcome) -> list[dict[str, Any]]:
    """Return the table of how each agent jumps, and what its training cost."""

    def cells(name: str) -> list[Cell]:
        columns = [_cell(outcome, name, measure) for measure in BEHAVIOUR]
        return [*columns, Cell(number(outcome.agents[name]["env_steps"]))]

    return _table(outcome, cells)


def terms(outcome: Outcome) -> tuple[list[str], list[dict[str, Any]]]:
    """Return the terms of the reward, none for a single one, and what each adds to the returns."""
    first, *_ = outcome.results.values()
    names = [name for name in first.quantities if name.startswith(TERM)]

    def cells(name: str) -> list[Cell]:
        agent = outcome.agents[name]
        return [_estimate(agent[term], agent["seeds"]) for term in names]

    return [name.removeprefix(TERM).replace("_", " ") for name in names], _table(outcome, cells)


def _table(outcome: Outcome, cells: Callable[[str], Sequence[Cell]]) -> list[dict[str, Any]]:
    """Return a row for each agent, whose remark is its robot if that is not the edited one."""
    return [
        {
            "label": agent.label,
            "family": agent.family,
            "remark": style.remark(False, agent.block.robot),
            "cells": cells(name),
        }
        for name, agent in outcome.results.items()
    ]


def _estimate(entry: Mapping[str, float] | None, num_seeds: int, is_best: bool = False) -> Cell:
    """Return a number with its interval; a dash for none."""
    if entry is None:
        return Cell()
    ends = interval(entry["low"], entry["high"], num_seeds)
    return Cell(number(entry["iqm"]), ends, is_best)


def _cell(outcome: Outcome, name: str, measure: str) -> Cell:
    """Return an agent's cell of a measure, marked if no agent that learns does better."""
    direction, agents = MEASURES[measure].is_better, outcome.agents
    scores = {
        learner: direction * agents[learner][measure]["iqm"]
        for learner in outcome.learners
        if direction and measure in agents[learner]
    }
    is_best = name in scores and scores[name] == max(scores.values())
    return _estimate(agents[name].get(measure), agents[name]["seeds"], is_best)
