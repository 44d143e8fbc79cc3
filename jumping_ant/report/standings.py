"""The report's charts of how much the agents return, and of what it costs to learn it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go

from jumping_ant.comparison import charting, comparison
from jumping_ant.comparison.results import AgentResults
from jumping_ant.experiment.curves import Unit
from jumping_ant.looks import style
from jumping_ant.looks.families import by_family
from jumping_ant.looks.style import COLOURS, INK, Look, estimate
from jumping_ant.report.charts import LOG_AXIS, ROW, SYMBOLS, finish, linear_axis


def ranking(
    results: Mapping[str, AgentResults], summary: Mapping[str, Any], drawn: Mapping[str, Look]
) -> go.Figure:
    """Draw the agents' returns with their intervals, the best on top, and every seed as a point."""
    figure = go.Figure()
    ranked = comparison.ranking(summary)
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
            x=[summary[name]["return"]["iqm"]],
            y=[results[name].label],
            mode="markers",
            marker=_marker(drawn[name]),
            error_x=_error(summary[name]["return"], drawn[name]),
            text=[_estimate(summary[name])],
            hovertemplate="%{y}: %{text}<extra></extra>",
            showlegend=False,
        )
    _name_families(figure, results)
    figure.update_xaxes(title=charting.RETURN, rangemode="tozero")
    labels = [results[name].label for name in ranked]
    figure.update_yaxes(categoryorder="array", categoryarray=labels, autorange="reversed")
    finish(figure, 110 + ROW * len(ranked), top=40)
    return figure.update_layout(legend={"y": 1, "yanchor": "bottom"})


def cost(
    results: Mapping[str, AgentResults],
    summary: Mapping[str, Any],
    unit: Unit,
    drawn: Mapping[str, Look],
) -> go.Figure:
    """Draw the learners' returns against their cost, with the Pareto front and the baselines.

    Of many learners only those on the front are named. The cost is in `unit`.
    """
    figure = go.Figure()
    agents, learners = summary["agents"], charting.learners(results)
    costs = [agents[name][comparison.COSTS[unit]] for name in learners]
    is_crowded = style.is_crowded(charting.families(results))
    named = summary[comparison.FRONTS[unit]] if is_crowded else learners
    _add_front(figure, *charting.front(results, summary, unit))
    for name, place in zip(learners, costs, strict=True):
        label = results[name].label
        figure.add_scatter(
            x=[place],
            y=[agents[name]["return"]["iqm"]],
            mode="markers+text",
            text=[label if name in named else ""],
            textposition="top left",
            cliponaxis=False,
            marker=_marker(drawn[name]),
            error_y=_error(agents[name]["return"], drawn[name]),
            hovertemplate=f"{label}: {_estimate(agents[name])} for %{{x:,.4~g}}<extra></extra>",
            showlegend=False,
        )
    best = comparison.best_baseline(results, agents)
    for name in (name for name in results if name not in learners):
        figure.add_hline(
            agents[name]["return"]["iqm"],
            line={"color": drawn[name].colour, "width": 1},
            layer="below",
            name=results[name].label,
            showlegend=name == best,
        )
    _name_families(figure, {name: results[name] for name in learners})
    figure.update_xaxes(title=charting.BUDGETS[unit], **_cost_axis(costs))
    figure.update_yaxes(title=charting.RETURN, rangemode="tozero")
    return finish(figure, 460)


def _cost_axis(costs: Sequence[float]) -> dict[str, Any]:
    """Return an axis on which names have room on the left of the costs."""
    if not charting.is_long(costs):
        return linear_axis(max(costs), 0.1)
    low, high = np.log10([min(costs), max(costs)])
    return LOG_AXIS | {"range": [1.35 * low - 0.35 * high, 1.1 * high - 0.1 * low]}


def _add_front(figure: go.Figure, costs: Sequence[float], returns: Sequence[float]) -> None:
    """Add the greatest return at each cost, up to the greatest cost."""
    figure.add_scatter(
        x=costs,
        y=returns,
        name="Pareto front",
        mode="lines",
        line={"color": INK, "width": 1.5, "shape": "hv"},
        hoverinfo="skip",
    )


def _name_families(figure: go.Figure, results: Mapping[str, AgentResults]) -> None:
    """Add the families' colours to the legend."""
    for family in by_family(charting.families(results)):
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
