"""Figures of the claims: a small panel for each, with every seed that it was judged by."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jumping_ant.showing import scales
from jumping_ant.words import looks
from jumping_ant.words.looks import Look
from jumping_ant.words.wording import p_value

COLUMNS = 2
MANY, MANY_COLUMNS = 24, 4  # with more claims than this, there are more columns
WIDTH = 62  # [characters] width of a panel's title
PAIR = "#B0B0B0"  # colour of the lines between values of the same seed


def draw(claims: Sequence[Mapping[str, Any]], drawn: Mapping[str, Look], title: str) -> Figure:
    """Draw one panel per claim, with its verdict.

    Args:
        claims: What `claims.verdicts.check` returns; at least one claim.
        drawn: Looks by the labels of agents.
        title: The figure's title.
    """
    columns = min(COLUMNS if len(claims) <= MANY else MANY_COLUMNS, len(claims))
    rows = -(-len(claims) // columns)
    figure = Figure(figsize=(5.2 * columns, 0.6 + 1.75 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, claim in zip(panels, claims, strict=False):
        _draw_claim(axes, claim, drawn)
    for axes in panels[len(claims) :]:
        axes.remove()
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure


def heading(claim: Mapping[str, Any]) -> str:
    """Return a claim's verdict with its corrected p value."""
    return f"{claim['verdict'].capitalize()}, p = {p_value(claim['p_holm'])} after Holm"


def _draw_claim(axes: Axes, claim: Mapping[str, Any], drawn: Mapping[str, Look]) -> None:
    plot = claim["plot"]
    samples = {label: _floats(values) for label, values in plot["values"].items()}
    if plot.get("paired"):
        rows = np.arange(len(samples))
        for seed in zip(*samples.values(), strict=True):
            axes.plot(seed, rows, color=PAIR, linewidth=0.8, zorder=1)
    for row, (label, values) in enumerate(samples.items()):
        reached = np.array(plot.get("reached", {}).get(label, [True] * len(values)))
        look = looks.of_sample(label, drawn)
        for chosen, fill in ((reached, look.colour), (~reached, "none")):
            axes.plot(
                values[chosen],
                np.full(chosen.sum(), row),
                look.marker,
                color=look.colour,
                markerfacecolor=fill,
                markersize=5,
                alpha=0.75,
            )
    scales.fit(axes, np.concatenate(list(samples.values())))
    axes.set_yticks(range(len(samples)), list(samples), fontsize=8)
    axes.set_ylim(len(samples) - 0.5, -0.5)
    axes.set_xlabel(plot["axis"], fontsize=8)
    axes.tick_params(axis="x", labelsize=8)
    axes.grid(False, axis="y")
    text = textwrap.fill(f"{heading(claim)}: {claim['text']}", WIDTH)
    axes.set_title(text, fontsize=8.5, color=looks.VERDICTS[claim["verdict"]])


def _floats(values: Sequence[float | None]) -> np.ndarray:
    """Return one number per seed, NaN where there is none."""
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)
