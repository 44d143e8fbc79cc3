"""The report's charts of who beats whom: all pairs of agents, and the claims."""

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import plotly.graph_objects as go

from jumping_ant.judging.results import AgentResults
from jumping_ant.showing.report.charts import LOG_AXIS, SYMBOLS, finish
from jumping_ant.words import looks
from jumping_ant.words.looks import Look
from jumping_ant.words.wording import interval, number

CLAIM_HEIGHT = 215  # [pixels]
PAIR = "#B0B4BC"  # colour of the lines between values of the same seed


def improvement(results: Mapping[str, AgentResults], summary: Mapping[str, Any]) -> go.Figure:
    """Draw the probability that a seed of one agent returns more than one of another."""
    pairs = summary["probability_of_improvement"]
    labels = [agent.label for agent in results.values()]
    chances = [[pairs.get(f"{one}>{other}") for other in results] for one in results]
    num_seeds = min(agent["seeds"] for agent in summary["agents"].values())
    figure = go.Figure()
    figure.add_heatmap(
        x=labels,
        y=labels,
        z=[[pair["p"] if pair else None for pair in row] for row in chances],
        text=[[_show_chance(pair, num_seeds) for pair in row] for row in chances],
        texttemplate="%{text}",
        zmin=0,
        zmax=1,
        colorscale=[[0, "#F4A582"], [0.5, "#F7F7F7"], [1, "#7FB6E0"]],
        showscale=False,
        xgap=3,
        ygap=3,
        hovertemplate="%{y} returns more than %{x}: %{text}<extra></extra>",
    )
    figure.update_xaxes(title="… than this one", side="bottom", showgrid=False)
    figure.update_yaxes(title="this one returns more …", autorange="reversed", showgrid=False)
    return finish(figure, 120 + 70 * len(results))


def claim(entry: Mapping[str, Any], drawn: Mapping[str, Look], seeds: Sequence[int]) -> go.Figure:
    """Draw the evidence that a claim was judged by: a point for each seed of each sample.

    Args:
        entry: An entry of `claims` in `results/comparison.json`.
        drawn: Looks by the labels of agents.
        seeds: The training seeds, in the order of the values.
    """
    plot = entry["plot"]
    figure = go.Figure()
    if plot.get("paired"):
        labels = [*plot["values"], None]
        pairs = [(*pair, None) for pair in zip(*plot["values"].values(), strict=True)]
        figure.add_scatter(
            x=list(chain(*pairs)),
            y=labels * len(pairs),
            mode="lines",
            line={"color": PAIR, "width": 1},
            hoverinfo="skip",
        )
    for label, values in plot["values"].items():
        reached = plot.get("reached", {}).get(label, [True] * len(values))
        figure.add_scatter(
            x=values,
            y=[label] * len(values),
            mode="markers",
            marker={
                "color": looks.of_sample(label, drawn).colour,
                "symbol": _symbols(looks.of_sample(label, drawn), reached),
                "size": 9,
                "opacity": 0.75,
            },
            text=[_show_seed(seed, there) for seed, there in zip(seeds, reached, strict=True)],
            hovertemplate="%{text}: %{x:,.4~g}<extra></extra>",
        )
    known = [value for values in plot["values"].values() for value in values if value is not None]
    figure.update_xaxes(
        title={"text": plot["axis"], "font": {"size": 12}},
        **(LOG_AXIS if looks.is_long(known) else {"rangemode": "tozero"}),
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


def _show_chance(pair: Mapping[str, float] | None, num_seeds: int) -> str:
    if pair is None:
        return ""
    ends = interval(pair["low"], pair["high"], num_seeds)
    return f"{number(pair['p'])}<br>{ends}".removesuffix("<br>")
