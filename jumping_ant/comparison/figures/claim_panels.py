"""Figures of the claims: a small panel for each, with every seed that it was judged by."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jumping_ant.comparison import charting
from jumping_ant.comparison.figures import scales
from jumping_ant.experiment import summaries
from jumping_ant.looks import style
from jumping_ant.looks.style import Look, p_value

COLUMNS = 2
MANY, MANY_COLUMNS = 24, 4  # with more claims than this, there are more columns
WIDTH = 62  # [characters] width of a panel's title


def draw(claims: Sequence[Mapping[str, Any]], drawn: Mapping[str, Look]) -> Figure:
    """Draw one panel per claim, with its verdict; `drawn` are looks by the agents' labels."""
    columns = min(COLUMNS if len(claims) <= MANY else MANY_COLUMNS, len(claims))
    rows = -(-len(claims) // columns)
    figure = Figure(figsize=(5.2 * columns, 0.6 + 1.75 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, claim in zip(panels, claims, strict=False):
        _draw_claim(axes, claim, drawn)
    for axes in panels[len(claims) :]:
        axes.remove()
    return figure


def heading(claim: Mapping[str, Any]) -> str:
    """Return a claim's verdict with the adjusted p value that decides it."""
    p = p_value(summaries.deciding_p(claim))
    return f"{claim['verdict'].capitalize()}, adjusted p = {p}"


def _draw_claim(axes: Axes, claim: Mapping[str, Any], drawn: Mapping[str, Look]) -> None:
    plot, samples = claim["plot"], charting.samples(claim["plot"])
    values = np.array([sample.values for sample in samples], dtype=np.float64)  # NaN for none
    if plot.get("paired"):
        axes.plot(values, range(len(samples)), color=style.PAIR, linewidth=0.8, zorder=1)
    for row, (sample, own) in enumerate(zip(samples, values, strict=True)):
        reached, look = np.array(sample.reached), style.of_sample(sample.label, drawn)
        for chosen, fill in ((reached, look.colour), (~reached, "none")):
            axes.plot(
                own[chosen],
                np.full(chosen.sum(), row),
                look.marker,
                color=look.colour,
                markerfacecolor=fill,
                markersize=5,
                alpha=0.75,
            )
    scales.fit(axes, values)
    axes.set_yticks(range(len(samples)), [sample.label for sample in samples], fontsize=8)
    axes.set_ylim(len(samples) - 0.5, -0.5)
    axes.set_xlabel(plot["axis"], fontsize=8)
    axes.tick_params(axis="x", labelsize=8)
    axes.grid(False, axis="y")
    text = textwrap.fill(f"{heading(claim)}: {claim['text']}", WIDTH)
    axes.set_title(text, fontsize=8.5, color=style.VERDICTS[claim["verdict"]])
