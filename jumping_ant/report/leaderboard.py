"""The report's charts of how much the agents return, and of what it costs to learn it."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import plotly.graph_objects as go

from jumping_ant.agents.families import Family, by_family
from jumping_ant.media.style import COLOURS, INK, Look, estimate
from jumping_ant.report.charts import LOG_AXIS, ROW, SYMBOLS, finish, linear_axis
from jumping_ant.report.outcome import RETURN, Outcome, is_long

COST = "Training and validation [control steps]"


def ranking(outcome: Outcome) -> go.Figure:
    """Draw the agents' returns with their intervals, the best on top, and every seed as a point."""
    figure = go.Figure()
    results, agents, drawn = outcome.results, outcome.agents, outcome.looks
    ranked = outcome.ranked
    for name in ranked:
        seeds = results[name].quantities["return"].tolist()
        figure.add_scatter(
            x=seeds,
            y=[results[name].label] * len(seeds),
            mode="markers",
            marker={"color": drawn[name].colour, "size": 5, "opacity": 0.35},
            hoverinfo="skip",
            showlegend=False,
        )
    for name in ranked:
        figure.add_scatter(
            x=[agents[name]["return"]["iqm"]],
            y=[results[name].label],
            mode="markers",
            marker=_marker(drawn[name]),
            error_x=_error(agents[name]["return"], drawn[name]),
            text=[_estimate(agents[name])],
            hovertemplate="%{y}: %{text}<extra></extra>",
            showlegend=False,
        )
    _name_families(figure, by_family(outcome.families))
    labels = [results[name].label for name in ranked]
    figure.update_xaxes(title=RETURN, rangemode="tozero")
    figure.update_yaxes(categoryorder="array", categoryarray=labels, autorange="reversed")
    finish(figure, 110 + ROW * len(ranked), top=40)
    return figure.update_layout(legend={"y": 1, "yanchor": "bottom"})


def cost(outcome: Outcome) -> go.Figure:
    """Draw the learners' returns against their cost, with the Pareto front and the baselines.

    Of many learners only those on the front are named. The cost is in control steps.
    """
    figure = go.Figure()
    results, agents, drawn = outcome.results, outcome.agents, outcome.looks
    front = outcome.summary["pareto_steps"]
    costs = {name: agents[name]["cost_steps"] for name in outcome.learners}
    returns = {name: agents[name]["return"]["iqm"] for name in results}
    figure.add_scatter(  # the greatest return at each cost, up to the greatest cost
        x=[*(costs[name] for name in front), max(costs.values())],
        y=[*(returns[name] for name in front), returns[front[-1]]],
        name="Pareto front",
        mode="lines",
        line={"color": INK, "width": 1.5, "shape": "hv"},
        hoverinfo="skip",
    )
    named = front if outcome.is_crowded else outcome.learners
    for name, place in costs.items():
        label = results[name].label
        figure.add_scatter(
            x=[place],
            y=[returns[name]],
            mode="markers+text",
            text=[label if name in named else ""],
            textposition="top left",
            cliponaxis=False,
            marker=_marker(drawn[name]),
            error_y=_error(agents[name]["return"], drawn[name]),
            hovertemplate=f"{label}: {_estimate(agents[name])} for %{{x:,.4~g}}<extra></extra>",
            showlegend=False,
        )
    for name in (name for name in results if name not in costs):
        figure.add_hline(
            returns[name],
            line={"color": drawn[name].colour, "width": 1},
            layer="below",
            name=results[name].label,
            showlegend=name == outcome.best_baseline,
        )
    _name_families(figure, by_family({name: outcome.families[name] for name in costs}))
    if is_long([*costs.values()]):  # with room for names on the left of the costs
        low, high = np.log10([min(costs.values()), max(costs.values())])
        axis = LOG_AXIS | {"range": [1.35 * low - 0.35 * high, 1.1 * high - 0.1 * low]}
    else:
        axis = linear_axis(max(costs.values()), 0.1)
    figure.update_xaxes(title=COST, **axis)
    figure.update_yaxes(title=RETURN, rangemode="tozero")
    return finish(figure, 460)


def _name_families(figure: go.Figure, families: Iterable[Family]) -> None:
    for family in families:
        figure.add_scatter(
            x=[None],
            y=[None],
            name=family,
            mode="markers",
            marker={"color": COLOURS[family], "size": 10, "symbol": "square"},
        )


def _marker(look: Look) -> dict[str, Any]:
    return {"color": look.colour, "symbol": SYMBOLS[look.marker], "size": 10}


def _error(entry: Mapping[str, float], look: Look) -> dict[str, Any]:
    """Return the bar of an interval; there is none for a single seed."""
    return {
        "type": "data",
        "symmetric": False,
        "array": [entry["high"] - entry["iqm"]],
        "arrayminus": [entry["iqm"] - entry["low"]],
        "color": look.colour,
        "thickness": 2,
        "width": 4,
    }


def _estimate(agent: Mapping[str, Any]) -> str:
    entry = agent["return"]
    return estimate(entry["iqm"], entry["low"], entry["high"], agent["seeds"])
