"""The pictures in `results/figures/`, which the documents show: learning curves, final returns.

All other charts are those of the report. Every agent has the same colour and marker in both (see
`jumping_ant.media.style`). The same numbers give the same bytes.
"""

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import EngFormatter

from jumping_ant.agents.families import by_family
from jumping_ant.comparison.comparison import LearningCurve
from jumping_ant.comparison.results import AgentResults
from jumping_ant.media.plotting import STYLES, entitle, render
from jumping_ant.media.style import COLOURS, INK, Look, number, panels
from jumping_ant.report.outcome import BUDGET, LEARNING, RETURN, Outcome, log_ends

KINDS: tuple[Literal["png", "svg"], ...] = ("png", "svg")
# Marks in a row of seeds, as matplotlib's keywords.
BAND: Any = {"linewidth": 7, "alpha": 0.25, "solid_capstyle": "butt"}
BAR: Any = {"linestyle": "", "marker": "|", "markersize": 16, "markeredgewidth": 2.5}
MEAN: Any = {"linestyle": "", "marker": "D", "markersize": 5, "markerfacecolor": "white"}
RING: Any = {"linestyle": "", "marker": "o", "markersize": 10, "markerfacecolor": "none"}


def draw(outcome: Outcome) -> dict[str, bytes]:
    """Return each figure's files, PNG and SVG, by name."""
    level = f"{100 * outcome.params.compare.confidence:g} %"
    interval = f"{level} interval (Student's t on the exact bootstrap standard error)"
    final = f"Return of the published policies, {interval}"
    learning = f"Return while learning: interquartile mean over seeds,\n{interval}"
    with style.context(STYLES):
        figures = {
            "learning_curves": entitle(learning_curves(outcome), learning),
            "final_return": entitle(final_return(outcome), final),
        }
    return {
        f"{name}.{kind}": render(figure, kind) for name, figure in figures.items() for kind in KINDS
    }


def learning_curves(outcome: Outcome) -> Figure:
    """Draw the returns while learning: one panel, or with many learners one for each family.

    In families' panels, baselines are thin lines, of which the best is named.
    """
    results, curves, drawn = outcome.results, outcome.curves, outcome.looks
    grouped = panels(outcome.families)
    height = 4 if len(grouped) == 1 else 0.9 + 2.2 * len(grouped)
    figure = Figure(figsize=(9, height), layout="constrained")
    rows = figure.subplots(len(grouped), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axes, (family, names) in zip(rows, grouped.items(), strict=True):
        for name in names:
            if family and results[name].is_baseline:
                label = results[name].label if name == outcome.best_baseline else "_"
                level = curves[name].returns.value[-1]
                axes.axhline(level, color=drawn[name].colour, linewidth=0.8, label=label)
            else:
                _draw_curve(axes, results[name], curves[name], drawn[name])
        if family:
            axes.set_title(family.capitalize())
            axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=9)
        axes.set_ylabel("Return" if family else LEARNING)
    if "" in grouped:
        handles, labels = rows[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=min(5, len(labels)))
    ends = log_ends([curve.trained for curve in curves.values()])
    if ends:
        rows[-1].set_xscale("log", nonpositive="clip")
        rows[-1].set_xlim(ends)
    rows[-1].xaxis.set_major_formatter(EngFormatter(sep=""))
    rows[-1].set_xlabel(BUDGET)
    rows[-1].set_ylim(bottom=0)
    return figure


def _draw_curve(axes: Axes, agent: AgentResults, curve: LearningCurve, look: Look) -> None:
    x, returns = curve.trained, curve.returns
    axes.fill_between(x, returns.low, returns.high, color=look.colour, alpha=0.15, linewidth=0)
    marks: Any = {"marker": "" if agent.is_baseline else look.marker, "markersize": 4}
    axes.plot(x, returns.value, look.line, color=look.colour, label=agent.label, **marks)


def final_return(outcome: Outcome) -> Figure:
    """Draw a row per agent, the best on top, with its seeds' returns and what sums them up."""
    ranked = outcome.ranked
    returns = {name: outcome.results[name].quantities["return"] for name in ranked}
    figure = Figure(figsize=(9, 0.9 + (0.7 + 0.4 * len(ranked))), layout="constrained")
    axes = figure.subplots()
    for row, (name, seeds) in enumerate(returns.items()):
        _draw_row(axes, row, seeds, outcome.agents[name]["return"], outcome.looks[name])
    axes.set_xlabel(RETURN)
    axes.grid(False, axis="y")
    values = np.concatenate([*returns.values()])
    if (values >= 0).all():  # the axis ends at zero where all returns lie on one side of it
        axes.set_xlim(left=0)
    elif (values <= 0).all():
        axes.set_xlim(right=0)
    axes.set_yticks(range(len(ranked)), [outcome.results[name].label for name in ranked])
    axes.set_ylim(len(ranked) - 0.5, -0.6)  # the first row on top
    handles = [
        Line2D([], [], label="seed", color=INK, linestyle="", marker="o", alpha=0.6),
        Line2D([], [], label="interquartile mean", color=INK, **BAR),
        Line2D([], [], label="its interval", color=INK, **BAND),
        Line2D([], [], label="mean", color=INK, **MEAN),
        Line2D([], [], label="worst seed", color=INK, **RING),
        *(
            Line2D([], [], label=family, color=COLOURS[family], linewidth=4)
            for family in by_family(outcome.families)
        ),
    ]
    figure.legend(handles=handles, loc="outside lower left", ncols=5, fontsize=9)
    return figure


def _draw_row(
    axes: Axes, row: int, seeds: np.ndarray, statistics: Mapping[str, float], look: Look
) -> None:
    iqm = statistics["iqm"]
    text: Any = {"textcoords": "offset points", "ha": "center", "fontsize": 8, "color": INK}
    axes.plot([statistics["low"], statistics["high"]], [row, row], color=look.colour, **BAND)
    points = np.full(len(seeds), row)
    axes.plot(seeds, points, look.marker, color=look.colour, markersize=5, alpha=0.6)
    axes.plot(iqm, row, color=look.colour, **BAR)
    axes.plot(statistics["mean"], row, color=look.colour, **MEAN)
    axes.annotate(number(iqm), (iqm, row), (0, 10), **text)
    axes.plot(statistics["worst"], row, color=INK, **RING)
