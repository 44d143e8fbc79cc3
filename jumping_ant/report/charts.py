"""The report's charts of learning and of all episodes, and what all its charts share.

They are Plotly figures, in which agents keep the colours and markers of all other figures (see
`jumping_ant.media.style`). Charts show exactly what `results/` holds: nothing is smoothed.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import plotly.graph_objects as go

from jumping_ant.comparison.comparison import LearningCurve
from jumping_ant.evaluation import measures
from jumping_ant.media.style import CHANCES, INK, Look
from jumping_ant.report.outcome import BUDGET, LEARNING, Outcome, log_ends

FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', sans-serif"
GRID = "#E6E8EC"
# Markers and lines of `jumping_ant.media.style` in Plotly's terms.
SYMBOLS = {
    "o": "circle",
    "s": "square",
    "^": "triangle-up",
    "D": "diamond",
    "v": "triangle-down",
    "P": "cross",
    "X": "x",
    "x": "x-thin-open",
}
DASHES = {"-": "solid", "--": "dash", ":": "dot", "-.": "dashdot"}
# Plotly chooses the numbers: powers of ten on a long axis, digits between them on a shorter one,
# even steps within a decade. `nticks` is low enough to keep long axes to powers.
LOG_AXIS = {"type": "log", "tickformat": "~s", "nticks": 4}
SHARES = {  # of a table of shares: its numbers on cells that are blue for 1, red for 0
    "texttemplate": "%{text}",
    "textfont": {"size": 11},
    "zmin": 0,
    "zmax": 1,
    "colorscale": [[i / 2, colour] for i, colour in enumerate(CHANCES)],
    "showscale": False,
    "xgap": 2,
    "ygap": 2,
}
ROW = 28  # [pixels] height of an agent's row
MENU = 460  # [pixels] height of the menu of measures, open


def learning(outcome: Outcome, names: Iterable[str]) -> go.Figure:
    """Draw some agents' return while learning, with its interval; all agents give the axes.

    Of many agents, baselines are thin lines, of which only the best is named.
    """
    figure = go.Figure()
    for name in names:
        agent, curve, look = outcome.results[name], outcome.curves[name], outcome.looks[name]
        line: dict[str, Any] = {
            "x": curve.trained.tolist(),
            "y": curve.returns.value.tolist(),
            "name": agent.label,
            "hovertemplate": "%{y:,.0f}",
        }
        if agent.is_baseline and outcome.is_crowded:
            line |= {"mode": "lines", "line": {"color": look.colour, "width": 1}}
            if name != outcome.best_baseline:
                line |= {"showlegend": False, "hovertemplate": None, "hoverinfo": "skip"}
        else:
            _add_band(figure, curve, look, name)
            line |= {
                "legendgroup": name,
                "mode": "lines" if agent.is_baseline else "lines+markers",
                "line": {"color": look.colour, "dash": DASHES[look.line]},
                "marker": {"symbol": SYMBOLS[look.marker], "size": 7},
            }
        figure.add_scatter(**line)
    curves = outcome.curves.values()
    highest = max(curve.returns.high.max() for curve in curves)
    lowest = min(curve.returns.low.min() for curve in curves)
    ends = log_ends([curve.trained for curve in curves])
    budget = max(float(curve.trained[-1]) for curve in curves)
    axis = LOG_AXIS | {"range": np.log10(ends).tolist()} if ends else linear_axis(budget, 0.03)
    figure.update_xaxes(title=BUDGET, hoverformat=",.3~s", **axis)
    figure.update_yaxes(title=LEARNING, range=[min(0, lowest), 1.05 * highest])
    return finish(figure, 380, hovermode="x unified")


def _add_band(figure: go.Figure, curve: LearningCurve, look: Look, group: str) -> None:
    x, low, high = (
        part.tolist() for part in (curve.trained, curve.returns.low, curve.returns.high)
    )
    red, green, blue = (int(look.colour[i : i + 2], 16) for i in (1, 3, 5))
    figure.add_scatter(
        x=x + x[::-1],
        y=high + low[::-1],
        fill="toself",
        fillcolor=f"rgba({red}, {green}, {blue}, 0.15)",
        line={"width": 0},
        mode="lines",
        hoverinfo="skip",
        legendgroup=group,
        showlegend=False,
    )


def episodes(outcome: Outcome) -> go.Figure:
    """Draw every held-out episode, one measure at a time, chosen from a menu."""
    figure = go.Figure()
    results = outcome.results
    first, *others = (agent.episodes for agent in results.values())
    columns = [name for name in first if all(name in table for table in others)]
    shown = {name: about for name in columns if (about := measures.of_column(name))}
    for measure in shown:
        for name, agent in results.items():
            numbered = zip(agent.episodes["seed"], agent.episodes["episode"], strict=True)
            figure.add_box(
                x=agent.episodes[measure].tolist(),
                name=agent.label,
                marker={"color": outcome.looks[name].colour, "size": 5, "opacity": 0.65},
                boxpoints="all",
                jitter=0.5,
                pointpos=0,
                text=[f"seed {seed:.0f}, episode {episode:.0f}" for seed, episode in numbered],
                hovertemplate="%{text}: %{x:,.4~g}<extra></extra>",
                hoveron="points",
                visible=measure == "return",
                showlegend=False,
            )
    add_menu(figure, {about.label: about.axis for about in shown.values()}, len(results))
    figure.update_xaxes(title=shown["return"].axis, rangemode="tozero")
    figure.update_yaxes(autorange="reversed")
    return finish(figure, max(MENU, 130 + ROW * len(results)), top=70)


def add_menu(figure: go.Figure, axes: Mapping[str, str], num_traces: int) -> None:
    """Add a menu of the titles of the x axis, by label; each shows the next `num_traces` traces."""
    buttons = [
        {
            "label": label,
            "method": "update",
            "args": [
                {"visible": [other == label for other in axes for _ in range(num_traces)]},
                {"xaxis.title.text": title},
            ],
        }
        for label, title in axes.items()
    ]
    menu = {"buttons": buttons, "x": 0, "xanchor": "left", "y": 1, "yanchor": "bottom"}
    figure.update_layout(updatemenus=[menu | {"pad": {"b": 10}}])


def linear_axis(most: float, room: float) -> dict[str, Any]:
    """Return an axis from 0 to `most`, with so much room of that on either side."""
    return {"range": [-room * most, (1 + room) * most], "tickformat": "~s"}


def finish(figure: go.Figure, height: int, top: int = 16, **layout: Any) -> go.Figure:
    """Give a figure the page's look; its width is that of the page."""
    figure.update_layout(
        template="plotly_white",
        height=height,
        margin={"l": 60, "r": 16, "t": top, "b": 50},
        font={"family": FONT, "size": 13, "color": INK},
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
        legend={"orientation": "h", "x": 0, "y": -0.2, "yanchor": "top"},
        **layout,
    )
    figure.update_xaxes(gridcolor=GRID, zeroline=False, automargin=True)
    figure.update_yaxes(gridcolor=GRID, zeroline=False, automargin=True)
    return figure
