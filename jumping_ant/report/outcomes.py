"""The report's tables of outcomes, as text."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from jumping_ant.comparison import charting, comparison
from jumping_ant.comparison.results import AgentResults
from jumping_ant.looks import style
from jumping_ant.looks.measures import MEASURES, TERM
from jumping_ant.looks.style import interval, number


@dataclass(frozen=True)
class Cell:
    """A number in a table, as text; `interval` is empty where there is none."""

    value: str = "\u2013"
    interval: str = ""
    is_best: bool = False


@dataclass(frozen=True)
class Row:
    """An agent's row: its name, its family, the robot if it is not the edited one, cells."""

    label: str
    family: str
    remark: str
    cells: Sequence[Cell]


def returns(
    results: Mapping[str, AgentResults], summary: Mapping[str, Any], confidence: float
) -> list[Row]:
    """Return each agent's returns: of published and final policies, and after equal control steps.

    `summary` is `agents` of `results/comparison.json`.
    """

    def cells(name: str) -> Iterator[Cell]:
        own = summary[name]["return"]
        yield _cell(results, summary, name, "return")
        yield Cell(number(own["mean"]))
        yield Cell(number(own["worst"]))
        final = results[name].variants.get("final")
        described = comparison.describe(final["return"], confidence) if final else None
        yield estimate(described, summary[name]["seeds"])
        if charting.learners(results):
            yield estimate(summary[name].get("return_at_equal_steps"), summary[name]["seeds"])

    return [row(agent, list(cells(name))) for name, agent in results.items()]


def behaviour(results: Mapping[str, AgentResults], summary: Mapping[str, Any]) -> list[Row]:
    """Return how each agent jumps, and what its training cost."""

    def cells(name: str) -> Iterator[Cell]:
        for measure in charting.BEHAVIOUR:
            yield _cell(results, summary, name, measure)
        yield Cell(number(summary[name]["env_steps"]))  # follow from params.yaml: none is best

    return [row(agent, list(cells(name))) for name, agent in results.items()]


def terms(
    results: Mapping[str, AgentResults], summary: Mapping[str, Any]
) -> tuple[list[str], list[Row]]:
    """Return the terms of the reward, none for a single one, and what each adds to the returns."""
    first = next(iter(results.values())).quantities
    names = [name for name in first if name.startswith(TERM)]

    def cells(name: str) -> list[Cell]:
        return [estimate(summary[name][term], summary[name]["seeds"]) for term in names]

    labels = [name.removeprefix(TERM).replace("_", " ") for name in names]
    return labels, [row(agent, cells(name)) for name, agent in results.items()]


def row(agent: AgentResults, cells: Sequence[Cell]) -> Row:
    """Return an agent's row."""
    return Row(agent.label, agent.family, style.remark(False, agent.block.robot), cells)


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
        for learner, agent in results.items()
        if direction and not agent.is_baseline and measure in summary[learner]
    }
    is_best = name in scores and scores[name] == max(scores.values())
    return estimate(summary[name].get(measure), summary[name]["seeds"], is_best)
