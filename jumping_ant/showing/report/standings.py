"""The report's charts of how much the agents return, and of what it costs to learn it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go

from jumping_ant.judging import comparison
from jumping_ant.judging.results import AgentResults
from jumping_ant.showing.report.charts import LOG_AXIS, ROW, SYMBOLS, finish
from jumping_ant.words import looks
from jumping_ant.words.looks import INK, Look
from jumping_ant.words.wording import estimate

COSTS = {  # keys of an agent's cost, and the axis's label
    "env_steps": "control steps",
    "train_seconds": "training time of a seed [s]",
}
LEAST_SPAN = 0.3  # decades between the least and the greatest cost that the axis has room for


def ranking(
    results: Mapping[str, AgentResults], summary: Mapping[str, Any], drawn: Mapping[str, Look]
) -> go.Figure:
    """Draw the agents' returns with their intervals, the best on top, and every seed as a point.

    Args:
        results: What `results.load` returns.
        summary: `agents` of `results/comparison.json`.
        drawn: Each agent's look.
    """
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
    figure.update_xaxes(title="return of a held-out episode", rangemode="tozero")
    labels = [results[name].label for name in ranked]
    figure.update_yaxes(categoryorder="array", categoryarray=labels, autorange="reversed")
    finish(figure, 110 + ROW * len(ranked), top=40)
    return figure.update_layout(legend={"y": 1, "yanchor": "bottom"})


def cost(
    results: Mapping[str, AgentResults],
    summary: Mapping[str, Any],
    against: str,
    drawn: Mapping[str, Look],
) -> go.Figure:
    """Draw the learners' returns against their cost, with the Pareto front and the baselines.

    Of many learners only those on the front are named.

    Args:
        results: What `results.load` returns, with a learner at least.
        summary: The content of `results/comparison.json`.
        against: A key of `COSTS`.
        drawn: Each agent's look.
    """
    figure = go.Figure()
    agents, front = summary["agents"], summary[comparison.FRONTS[against]]
    learners = [name for name, agent in results.items() if not agent.is_baseline]
    is_crowded = looks.is_crowded({name: results[name].family for name in learners})
    named = front if is_crowded else learners
    _add_front(figure, agents, against, front, learners)
    for name in learners:
        label = results[name].label
        figure.add_scatter(
            x=[agents[name][against]],
            y=[agents[name]["return"]["iqm"]],
            mode="markers+text",
            text=[label if name in named else ""],
            textposition="top left",
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
    figure.update_xaxes(title=COSTS[against], range=_range(agents, against, learners), **LOG_AXIS)
    figure.update_yaxes(title="return of a held-out episode", rangemode="tozero")
    return finish(figure, 460)


def _range(agents: Mapping[str, Any], against: str, learners: Sequence[str]) -> list[float]:
    """Return the ends of the logarithmic axis of costs, with room for names on the left."""
    costs = np.log10([agents[name][against] for name in learners])
    span = max(float(np.ptp(costs)), LEAST_SPAN)
    return [float(costs.min()) - 0.35 * span, float(costs.max()) + 0.1 * span]


def _add_front(
    figure: go.Figure,
    agents: Mapping[str, Any],
    against: str,
    front: Sequence[str],
    learners: Sequence[str],
) -> None:
    """Add the greatest return at each cost, up to the greatest cost."""
    returns = [agents[name]["return"]["iqm"] for name in front]
    figure.add_scatter(
        x=[*(agents[name][against] for name in front), max(agents[n][against] for n in learners)],
        y=[*returns, returns[-1]],
        name="Pareto front",
        mode="lines",
        line={"color": INK, "width": 1.5, "shape": "hv"},
        hoverinfo="skip",
    )


def _name_families(figure: go.Figure, results: Mapping[str, AgentResults]) -> None:
    """Add the families' colours to the legend."""
    for family in looks.by_family({name: agent.family for name, agent in results.items()}):
        figure.add_scatter(
            x=[None],
            y=[None],
            name=family,
            mode="markers",
            marker={"color": looks.COLOURS[family], "size": 10, "symbol": "square"},
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
