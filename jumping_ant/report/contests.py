"""The report's charts of who beats whom: all pairs of agents, and the claims."""

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import plotly.graph_objects as go

from jumping_ant.comparison import charting
from jumping_ant.comparison.charting import chance_text
from jumping_ant.comparison.results import AgentResults
from jumping_ant.looks import style
from jumping_ant.looks.style import Look
from jumping_ant.report.charts import LOG_AXIS, SHARES, SYMBOLS, finish

CLAIM_HEIGHT = 215  # [pixels]
NARROW = 27  # [pixels] side of a cell of the matrix that shows no interval


def improvement(results: Mapping[str, AgentResults], summary: Mapping[str, Any]) -> go.Figure:
    """Draw the probability that a seed of one agent returns more than one of another."""
    labels, chances = charting.duels(results, summary)
    has_room = charting.has_room(len(labels))
    figure = go.Figure()
    figure.add_heatmap(
        x=labels,
        y=labels,
        z=[[one["p"] if one else None for one in row] for row in chances],
        text=[[chance_text(one, has_room, "<br>") for one in row] for row in chances],
        customdata=[[chance_text(one, True, " %, interval ") for one in row] for row in chances],
        hovertemplate="%{y} returns more than %{x}: %{customdata} %<extra></extra>",
        **SHARES,
    )
    figure.update_xaxes(title=charting.LOSER, side="top", showgrid=False, tickangle=-90)
    figure.update_yaxes(title=charting.WINNER, autorange="reversed", showgrid=False)
    return finish(figure, 180 + (44 if has_room else NARROW) * len(labels))


def improvement_width(num_agents: int) -> int:
    """Return the least width of the matrix with so many agents [pixels]."""
    return 160 + (52 if charting.has_room(num_agents) else NARROW) * num_agents


def claim(entry: Mapping[str, Any], drawn: Mapping[str, Look], seeds: Sequence[int]) -> go.Figure:
    """Draw the evidence that a claim was judged by; `drawn` are looks by the agents' labels."""
    plot = entry["plot"]
    figure = go.Figure()
    if plot.get("paired"):
        labels = [*plot["values"], None]
        pairs = [(*pair, None) for pair in zip(*plot["values"].values(), strict=True)]
        figure.add_scatter(
            x=list(chain(*pairs)),
            y=labels * len(pairs),
            mode="lines",
            line={"color": style.PAIR, "width": 1},
            hoverinfo="skip",
        )
    for sample in charting.samples(plot):
        look = style.of_sample(sample.label, drawn)
        figure.add_scatter(
            x=sample.values,
            y=[sample.label] * len(sample.values),
            mode="markers",
            marker={
                "color": look.colour,
                "symbol": _symbols(look, sample.reached),
                "size": 9,
                "opacity": 0.75,
            },
            text=list(map(_show_seed, seeds, sample.reached)),
            hovertemplate="%{text}: %{x:,.4~g}<extra></extra>",
        )
    known = [value for values in plot["values"].values() for value in values if value is not None]
    figure.update_xaxes(
        title={"text": plot["axis"], "font": {"size": 12}},
        **(LOG_AXIS if charting.is_long(known) else {"rangemode": "tozero"}),
    )
    figure.update_yaxes(autorange="reversed", type="category", showgrid=False)
    return finish(figure, CLAIM_HEIGHT, showlegend=False)


def _symbols(look: Look, reached: Sequence[bool]) -> list[str]:
    """Return a marker for each seed, hollow where its value is only a bound."""
    filled = SYMBOLS[look.marker]
    hollow = f"{filled.removesuffix('-open')}-open"
    return [filled if there else hollow for there in reached]


def _show_seed(seed: int, reached: bool) -> str:
    return f"seed {seed}" if reached else f"seed {seed}, which never got there"
