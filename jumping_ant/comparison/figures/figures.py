"""Figures of the comparison.

Every agent keeps its colour and marker in all figures (see `jumping_ant.looks.style`). The same
numbers give the same bytes.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from jumping_ant.comparison import charting, comparison
from jumping_ant.comparison.comparison import LearningCurve
from jumping_ant.comparison.figures import (
    claim_panels,
    cost_panels,
    curve_panels,
    pair_matrix,
    scales,
)
from jumping_ant.comparison.results import AgentResults
from jumping_ant.experiment.curves import Unit
from jumping_ant.looks.families import Family, by_family
from jumping_ant.looks.measures import MEASURES
from jumping_ant.looks.plotting import STYLES, entitle, render
from jumping_ant.looks.style import COLOURS, INK, Look, looks, number

# Marks in a row of seeds, as matplotlib's keywords.
BAND: Any = {"linewidth": 7, "alpha": 0.25, "solid_capstyle": "butt"}
BAR: Any = {"linestyle": "", "marker": "|", "markersize": 16, "markeredgewidth": 2.5}
MEAN: Any = {"linestyle": "", "marker": "D", "markersize": 5, "markerfacecolor": "white"}
RING: Any = {"linestyle": "", "marker": "o", "markersize": 10, "markerfacecolor": "none"}

MOST_IN_TWO_ROWS = 12  # agents; more of them have all panels side by side


def draw(
    results: Mapping[str, AgentResults],
    curves: Mapping[str, LearningCurve],
    summary: Mapping[str, Any],
    claims: Sequence[Mapping[str, Any]],
    confidence: float,
) -> dict[str, Figure]:
    """Draw all figures that there is something for, by file name without its extension."""
    drawn = looks(charting.families(results))
    ranked = {name: results[name] for name in comparison.ranking(summary["agents"])}
    with style.context(STYLES):
        figures = {
            "final_return": _draw_quantities(ranked, summary, drawn, {"return": charting.RETURN}),
            "behaviour": _draw_quantities(ranked, summary, drawn, charting.BEHAVIOUR),
        }
        if len(results) > 1:
            figures["probability_of_improvement"] = pair_matrix.draw(results, summary)
        titled = _entitled(figures, confidence, len(results))
    return titled | draw_costs(results, curves, summary, claims, confidence)


def draw_costs(
    results: Mapping[str, AgentResults],
    curves: Mapping[str, LearningCurve],
    summary: Mapping[str, Any],
    claims: Sequence[Mapping[str, Any]],
    confidence: float,
    unit: Unit = "env_steps",
) -> dict[str, Figure]:
    """Draw what has a unit of training: curves and a summary with their front, and claims."""
    drawn = looks(charting.families(results))
    reference = comparison.best_baseline(results, summary["agents"])
    with style.context(STYLES):
        figures = {"learning_curves": curve_panels.draw(results, curves, drawn, reference, unit)}
        if charting.learners(results):
            figures["efficiency"] = cost_panels.draw(results, summary, drawn, reference, unit)
        if claims:
            by_label = {agent.label: drawn[name] for name, agent in results.items()}
            figures["claims"] = claim_panels.draw(claims, by_label)
        return _entitled(figures, confidence, len(results))


def files(figures: Mapping[str, Figure]) -> dict[str, bytes]:
    """Return the content of each figure's files, PNG and SVG, by file name."""
    kinds: tuple[Literal["png", "svg"], ...] = ("png", "svg")
    return {
        f"{name}.{kind}": render(figure, kind) for name, figure in figures.items() for kind in kinds
    }


def _entitled(
    figures: Mapping[str, Figure], confidence: float, num_agents: int
) -> dict[str, Figure]:
    """Give each figure its title, which says what interval it shows."""
    percent = f"{100 * confidence:g} %"
    interval = f"{percent} interval (Student's t on the exact bootstrap standard error)"
    has_room = charting.has_room(num_agents)
    bootstrap = f", {percent} interval (percentile bootstrap)" if has_room else ""
    titles = {
        "learning_curves": f"Return while learning: interquartile mean over seeds,\n{interval}",
        "final_return": f"Return of the published policies, {interval}",
        "behaviour": f"How they jump, {interval}",
        "efficiency": (
            f"What the return costs: interquartile mean over seeds, {percent} interval,\n"
            "and Pareto front of the learners; grey: baselines"
        ),
        "probability_of_improvement": f"Probability of improvement [%]{bootstrap}",
        "claims": (
            "The claims: every seed is a point. Hollow: it never got there and spent this much.\n"
            "Lines join values of the same seed."
        ),
    }
    return {name: entitle(figure, titles[name]) for name, figure in figures.items()}


def _draw_quantities(
    results: Mapping[str, AgentResults],
    summary: Mapping[str, Any],
    drawn: Mapping[str, Look],
    labels: Mapping[str, str],
) -> Figure:
    """Draw one panel per quantity: a row per agent, with its seeds and their summary."""
    columns = min(2 if len(results) <= MOST_IN_TWO_ROWS else len(labels), len(labels))
    rows = -(-len(labels) // columns)
    size = (max(9, 3.6 * columns), 0.9 + rows * (0.7 + 0.4 * len(results)))
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
    for axes, (quantity, label) in zip(panels, labels.items(), strict=True):
        for row, (name, agent) in enumerate(results.items()):
            statistics = summary["agents"][name].get(quantity)
            if statistics:  # some seed has a value
                _draw_seeds(axes, row, agent.quantities[quantity], statistics, drawn[name])
                if MEASURES[quantity].is_better:
                    _ring(axes, row, statistics["worst"])
        axes.set_xlabel(label)
        axes.grid(False, axis="y")
        values = np.concatenate([agent.quantities[quantity] for agent in results.values()])
        scales.anchor_at_zero(axes, values[~np.isnan(values)])
    _name_rows(panels[0], [agent.label for agent in results.values()])
    handles = _legend(by_family(charting.families(results)))
    figure.legend(handles=handles, loc="outside lower left", ncols=5, fontsize=9)
    return figure


def _legend(families: Iterable[Family]) -> list[Line2D]:
    """Return the legend entries for the marks of `_draw_seeds` and `_ring`, and for the colours."""
    return [
        Line2D([], [], label="seed", color=INK, linestyle="", marker="o", alpha=0.6),
        Line2D([], [], label="interquartile mean", color=INK, **BAR),
        Line2D([], [], label="its interval", color=INK, **BAND),
        Line2D([], [], label="mean", color=INK, **MEAN),
        Line2D([], [], label="worst seed", color=INK, **RING),
        *(Line2D([], [], label=one, color=COLOURS[one], linewidth=4) for one in families),
    ]


def _ring(axes: Axes, row: int, value: float) -> None:
    axes.plot(value, row, color=INK, **RING)


def _draw_seeds(
    axes: Axes, row: int, seeds: np.ndarray, statistics: Mapping[str, float], look: Look
) -> None:
    ends = [statistics["low"], statistics["high"]]
    axes.plot(ends, [row, row], color=look.colour, **BAND)
    points = np.full(len(seeds), row)
    axes.plot(seeds, points, look.marker, color=look.colour, markersize=5, alpha=0.6)
    iqm = statistics["iqm"]
    axes.plot(iqm, row, color=look.colour, **BAR)
    axes.plot(statistics["mean"], row, color=look.colour, **MEAN)
    axes.annotate(
        number(iqm),
        (iqm, row),
        (0, 10),
        textcoords="offset points",
        ha="center",
        fontsize=8,
        color=INK,
    )


def _name_rows(axes: Axes, names: Sequence[str]) -> None:
    """Label the rows of a chart, the first one on top."""
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.6)
