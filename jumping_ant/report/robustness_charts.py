"""The report's charts of what agents keep of their return under perturbations."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import plotly.graph_objects as go

from jumping_ant.comparison.results import AgentResults
from jumping_ant.media.style import Look, percent, percents
from jumping_ant.report.charts import DASHES, MENU, ROW, SHARES, SYMBOLS, finish
from jumping_ant.sim.levels import LEVELS

OVERTAKEN = "\u2193"  # an arrow
KEPT = "Share of the undisturbed return that is kept"


def overview(results: Mapping[str, AgentResults], withstood: Mapping[str, Any]) -> go.Figure:
    """Draw what each agent keeps under the most severe level of each perturbation."""
    shown = [name for name in results if name in withstood["agents"]]
    rows = [withstood["agents"][name] for name in shown]
    columns = withstood["perturbations"]
    figure = go.Figure()
    figure.add_heatmap(
        x=[_named(column) for column in columns],
        y=[results[name].label for name in shown],
        z=[[row[column]["retention"][-1] for column in columns] for row in rows],
        text=[[_cell(row[column]) for column in columns] for row in rows],
        customdata=[[_told(row[column], column) for column in columns] for row in rows],
        hovertemplate="%{y}, %{x}: %{customdata}<extra></extra>",
        **SHARES,
    )
    figure.update_xaxes(side="top", showgrid=False, tickangle=-60)
    figure.update_yaxes(autorange="reversed", showgrid=False)
    return finish(figure, 180 + 44 * len(shown))


def levels(
    results: Mapping[str, AgentResults],
    withstood: Mapping[str, Any],
    drawn: Mapping[str, Look],
) -> go.Figure:
    """Draw what agents keep at each level of one perturbation, chosen from a menu."""
    figure = go.Figure()
    shown = [name for name in results if name in withstood["agents"]]
    names = withstood["perturbations"]
    for column in names:
        for name in shown:
            own, look = withstood["agents"][name][column], drawn[name]
            kept, low, high = (np.array(own[key], float) for key in ("retention", "low", "high"))
            figure.add_scatter(
                x=[f"{level:g}" for level in own["level"]],
                y=own["retention"],
                error_y={
                    "array": (high - kept).tolist(),
                    "arrayminus": (kept - low).tolist(),
                    "thickness": 1,
                    "width": 0,
                },
                name=results[name].label,
                mode="lines+markers",
                line={"color": look.colour, "dash": DASHES[look.line]},
                marker={"symbol": SYMBOLS[look.marker], "size": 7},
                visible=column == names[0],
                hovertemplate="%{y:.0%}",
            )
    buttons = [
        {
            "label": _named(column),
            "method": "update",
            "args": [
                {"visible": [other == column for other in names for _ in shown]},
                {"xaxis.title.text": _axis(column)},
            ],
        }
        for column in names
    ]
    menu = {"buttons": buttons, "x": 0, "xanchor": "left", "y": 1, "yanchor": "bottom"}
    figure.update_layout(updatemenus=[menu | {"pad": {"b": 10}}])
    figure.update_xaxes(title=_axis(names[0]), type="category")
    figure.update_yaxes(title=KEPT, tickformat=".0%", rangemode="tozero")
    return finish(figure, MENU + ROW, top=70, hovermode="x unified")


def _named(perturbation: str) -> str:
    return perturbation.replace("_", " ").capitalize()


def _axis(perturbation: str) -> str:
    """Return what the levels of a perturbation are, with their unit."""
    unit, _, text = LEVELS[perturbation].about.partition("] ")
    return f"{text.partition(';')[0].rstrip('.')} {unit}]"


def _cell(own: Mapping[str, Any]) -> str:
    """Return what is kept at the most severe level, marked where a rhythm is well ahead there."""
    kept = own["retention"][-1]
    if kept is None:
        return ""
    return percent(kept) if own["crossing"] is None else f"{percent(kept)} {OVERTAKEN}"


def _told(own: Mapping[str, Any], perturbation: str) -> str:
    """Return what an agent withstands, in words."""
    if own["retention"][-1] is None:
        return "it returned nothing without perturbation"
    interval = percents(own["low"][-1], own["high"][-1])
    told = f"keeps {percent(own['retention'][-1])} % ({interval}) at {own['level'][-1]:g}"
    if own["half"] is not None:
        told += f"; less than half from {own['half']:g} on"
    if own["crossing"] is not None:
        told += f"; the metronome leads by more than the margin from {own['crossing']:g} on"
    return told
