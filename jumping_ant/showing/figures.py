"""Figures of the comparison.

Every agent keeps its colour and marker in all figures (see `jumping_ant.words.looks`). The same
numbers give the same bytes.
"""

import io
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any, Literal

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import EngFormatter

from jumping_ant.judging.comparison import LearningCurve
from jumping_ant.judging.results import AgentResults
from jumping_ant.showing import claim_panels
from jumping_ant.words.looks import INK, Look, looks
from jumping_ant.words.measures import MEASURES
from jumping_ant.words.wording import number

STYLE: Any = {  # matplotlib types it by each key's name
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.titlelocation": "left",
    "axes.titlesize": 11,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E5E5E5",
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "savefig.dpi": 150,
    "svg.hashsalt": "jumping-ant",  # the SVG's element names are random without it
}
STYLES = ["default", STYLE]  # whatever the reader's own matplotlibrc says

# Marks in a row of seeds, as matplotlib's keywords.
BAND: Any = {"linewidth": 7, "alpha": 0.25, "solid_capstyle": "butt"}
BAR: Any = {"linestyle": "", "marker": "|", "markersize": 16, "markeredgewidth": 2.5}
MEAN: Any = {"linestyle": "", "marker": "D", "markersize": 5, "markerfacecolor": "white"}
RING: Any = {"linestyle": "", "marker": "o", "markersize": 10, "markerfacecolor": "none"}

RETURN = {"return": "Return per held-out episode"}
BEHAVIOUR = {  # axis labels of the quantities drawn, where they were measured
    "apex": "Apex of a jump [m]",
    "flight": "Share of time in flight",
    "fluidity": "Fluidity (closer to 0 is more fluid)",
    "jumps": "Jumps per episode",
}

CLAIMS_TITLE = (
    "The claims: every seed is a point. Hollow: it never got there and spent this much.\n"
    "Lines join values of the same seed."
)


def draw(
    results: Mapping[str, AgentResults],
    curves: Mapping[str, LearningCurve],
    summary: Mapping[str, Any],
    claims: Sequence[Mapping[str, Any]],
    confidence: float,
) -> dict[str, Figure]:
    """Draw all figures; the figure of pairs needs two agents, the figure of claims a claim.

    Args:
        results: What `results.load` returns.
        curves: What `comparison.learning_curves` returns.
        summary: What `comparison.summarize` returns.
        claims: What `claims.verdicts.check` returns.
        confidence: Confidence level of the intervals, for the titles.

    Returns:
        Figures by file name, without its extension.
    """
    drawn = looks({name: agent.is_baseline for name, agent in results.items()})
    percent = f"{100 * confidence:g} %"
    interval = f"{percent} interval (Student's t on the exact bootstrap standard error)"
    with style.context(STYLES):
        figures = {
            "learning_curves": _draw_curves(
                results,
                curves,
                drawn,
                f"Return while learning: interquartile mean over seeds,\n{interval}",
            ),
            "final_return": _draw_quantities(
                results, summary, drawn, RETURN, f"Return of the published policies, {interval}"
            ),
            "behaviour": _draw_quantities(
                results, summary, drawn, BEHAVIOUR, f"How they jump, {interval}"
            ),
        }
        if len(results) > 1:
            figures["probability_of_improvement"] = _draw_probabilities(
                results,
                summary,
                drawn,
                f"Probability of improvement, {percent} interval (percentile bootstrap)",
            )
        if claims:
            by_label = {agent.label: drawn[name] for name, agent in results.items()}
            figures["claims"] = claim_panels.draw(claims, by_label, CLAIMS_TITLE)
    return figures


def render(figure: Figure, kind: Literal["png", "svg"]) -> bytes:
    """Return a figure as a file's content, without dates and versions."""
    content = io.BytesIO()
    metadata = {"png": {"Software": None}, "svg": {"Date": None, "Creator": None}}[kind]
    with style.context(STYLES):
        figure.savefig(content, format=kind, metadata=metadata)
    return content.getvalue()


def files(figures: Mapping[str, Figure]) -> dict[str, bytes]:
    """Return the content of each figure's files, PNG and SVG, by file name."""
    kinds: tuple[Literal["png", "svg"], ...] = ("png", "svg")
    return {
        f"{name}.{kind}": render(figure, kind) for name, figure in figures.items() for kind in kinds
    }


def _draw_curves(
    results: Mapping[str, AgentResults],
    curves: Mapping[str, LearningCurve],
    looks: Mapping[str, Look],
    title: str,
) -> Figure:
    figure = Figure(figsize=(9, 4), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for name, curve in curves.items():
        for axes, x in ((left, curve.env_steps), (right, curve.seconds)):
            _draw_band(axes, x, curve, looks[name], results[name].label)
    _scale_time(left, [curve.env_steps for curve in curves.values()])
    _scale_time(right, [curve.seconds for curve in curves.values()])
    left.set(xlabel="Training budget [control steps]", ylabel="Return per evaluation episode")
    right.set(xlabel="Training time per seed [s]")
    left.set_ylim(bottom=0)
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(5, len(labels)))
    return figure


def _draw_band(axes: Axes, x: np.ndarray, curve: LearningCurve, look: Look, label: str) -> None:
    returns = curve.returns
    axes.fill_between(x, returns.low, returns.high, color=look.colour, alpha=0.18, linewidth=0)
    marker = look.marker if look.line == "-" else ""
    axes.plot(
        x, returns.value, look.line, color=look.colour, marker=marker, markersize=4, label=label
    )


def _scale_time(axes: Axes, times: Sequence[np.ndarray]) -> None:
    """Use a logarithmic axis if budgets differ more than tenfold, otherwise a linear one."""
    lasts = [float(own[-1]) for own in times if own[-1] > 0]
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))
    if lasts and max(lasts) > 10 * min(lasts):
        axes.set_xscale("log", nonpositive="clip")
        axes.xaxis.set_major_formatter(EngFormatter(sep=""))
        firsts = [float(own[own > 0][0]) for own in times if (own > 0).any()]
        axes.set_xlim(0.8 * min(firsts), 1.2 * max(lasts))


def _draw_quantities(
    results: Mapping[str, AgentResults],
    summary: Mapping[str, Any],
    looks: Mapping[str, Look],
    labels: Mapping[str, str],
    title: str,
) -> Figure:
    """Draw one panel per quantity: a row per agent, with its seeds and their summary."""
    columns = min(2, len(labels))
    rows = -(-len(labels) // columns)
    figure = Figure(figsize=(9, 0.9 + rows * (0.7 + 0.4 * len(results))), layout="constrained")
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
    for axes, (quantity, label) in zip(panels, labels.items(), strict=True):
        for row, (name, agent) in enumerate(results.items()):
            statistics = summary["agents"][name].get(quantity)
            if statistics:  # some seed has a value
                _draw_seeds(axes, row, agent.quantities[quantity], statistics, looks[name])
                if MEASURES[quantity].is_better:
                    _ring(axes, row, statistics["worst"])
        axes.set_xlabel(label)
        axes.grid(False, axis="y")
        values = np.concatenate([agent.quantities[quantity] for agent in results.values()])
        claim_panels.anchor_at_zero(axes, values[~np.isnan(values)])
    _name_rows(panels[0], [agent.label for agent in results.values()])
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    figure.legend(handles=_legend(), loc="outside lower left", ncols=5, fontsize=9)
    return figure


def _legend() -> list[Line2D]:
    """Return the legend entries for the marks of `_draw_seeds` and `_ring`."""
    return [
        Line2D([], [], label="seed", color=INK, linestyle="", marker="o", alpha=0.6),
        Line2D([], [], label="interquartile mean", color=INK, **BAR),
        Line2D([], [], label="its interval", color=INK, **BAND),
        Line2D([], [], label="mean", color=INK, **MEAN),
        Line2D([], [], label="worst seed", color=INK, **RING),
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


def _draw_probabilities(
    results: Mapping[str, AgentResults],
    summary: Mapping[str, Any],
    looks: Mapping[str, Look],
    title: str,
) -> Figure:
    """Draw one row per pair of agents; the one that wins more often is named first."""
    pairs = summary["probability_of_improvement"]
    better = [
        (one, other) if pairs[f"{one}>{other}"]["p"] >= 0.5 else (other, one)
        for one, other in combinations(results, 2)
    ]
    figure = Figure(figsize=(9, 1.2 + 0.34 * len(better)), layout="constrained")
    axes = figure.subplots()
    axes.axvline(0.5, color=INK, linewidth=1, linestyle=":")
    for row, (one, other) in enumerate(better):
        _draw_probability(axes, row, pairs[f"{one}>{other}"], looks[one])
    axes.set_xlim(0, 1.08)
    axes.set_xticks(np.linspace(0, 1, 5))
    axes.set_xlabel("Probability that a seed of the first returns more than one of the second")
    axes.grid(False, axis="y")
    _name_rows(axes, [f"{results[one].label} over {results[other].label}" for one, other in better])
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure


def _draw_probability(axes: Axes, row: int, pair: Mapping[str, float], look: Look) -> None:
    ends = [pair["low"], pair["high"]]
    axes.plot(ends, [row, row], color=look.colour, **BAND)
    axes.plot(pair["p"], row, look.marker, color=look.colour, markersize=7)
    axes.annotate(
        f"{pair['p']:.2f}",
        (pair["p"], row),
        (9, 0),
        textcoords="offset points",
        va="center",
        fontsize=8,
        color=INK,
    )


def _name_rows(axes: Axes, names: Sequence[str]) -> None:
    """Label the rows of a chart, the first one on top."""
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.6)
