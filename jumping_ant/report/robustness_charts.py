"""The report's charts of what agents keep of their return under perturbations."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import plotly.graph_objects as go

from jumping_ant.media.style import percent, percents
from jumping_ant.report.charts import DASHES, MENU, ROW, SHARES, SYMBOLS, add_menu, finish
from jumping_ant.report.outcome import Outcome
from jumping_ant.sim.levels import LEVELS

KEPT = "Share of the undisturbed return that is kept"


def overview(outcome: Outcome, withstood: Mapping[str, Any]) -> go.Figure:
    """Draw what each agent keeps under the most severe level of each perturbation."""
    labels = {name: agent.label for name, agent in outcome.results.items()}
    shown = [name for name in labels if name in withstood["agents"]]
    rows = [withstood["agents"][name] for name in shown]
    columns = withstood["perturbations"]
    figure = go.Figure()
    figure.add_heatmap(
        x=[_label(column) for column in columns],
        y=[labels[name] for name in shown],
        z=[[row[column]["retention"][-1] for column in columns] for row in rows],
        text=[[_cell(row[column]) for column in columns] for row in rows],
        customdata=[[_in_words(row[column]) for column in columns] for row in rows],
        hovertemplate="%{y}, %{x}: %{customdata}<extra></extra>",
        **SHARES,
    )
    figure.update_xaxes(side="top", showgrid=False, tickangle=-60)
    figure.update_yaxes(autorange="reversed", showgrid=False)
    return finish(figure, 180 + 44 * len(shown))


def levels(outcome: Outcome, withstood: Mapping[str, Any]) -> go.Figure:
    """Draw what agents keep at each level of one perturbation, chosen from a menu."""
    figure = go.Figure()
    shown = [name for name in outcome.results if name in withstood["agents"]]
    columns = withstood["perturbations"]
    for column in columns:
        for name in shown:
            entry, look = withstood["agents"][name][column], outcome.looks[name]
            kept, low, high = (np.array(entry[key], float) for key in ("retention", "low", "high"))
            figure.add_scatter(
                x=[f"{level:g}" for level in entry["level"]],
                y=entry["retention"],
                error_y={
                    "array": (high - kept).tolist(),
                    "arrayminus": (kept - low).tolist(),
                    "thickness": 1,
                    "width": 0,
                },
                name=outcome.results[name].label,
                mode="lines+markers",
                line={"color": look.colour, "dash": DASHES[look.line]},
                marker={"symbol": SYMBOLS[look.marker], "size": 7},
                visible=column == columns[0],
                hovertemplate="%{y:.0%}",
            )
    add_menu(figure, {_label(column): _axis(column) for column in columns}, len(shown))
    figure.update_xaxes(title=_axis(columns[0]), type="category")
    figure.update_yaxes(title=KEPT, tickformat=".0%", rangemode="tozero")
    return finish(figure, MENU + ROW, top=70, hovermode="x unified")


def _label(perturbation: str) -> str:
    return perturbation.replace("_", " ").capitalize()


def _axis(perturbation: str) -> str:
    """Return what the levels of a perturbation are, with their unit."""
    unit, _, text = LEVELS[perturbation].about.partition("] ")
    return f"{text.partition(';')[0].rstrip('.')} {unit}]"


def _cell(entry: Mapping[str, Any]) -> str:
    """Return what is kept at the most severe level."""
    kept = entry["retention"][-1]
    return "" if kept is None else percent(kept)


def _in_words(entry: Mapping[str, Any]) -> str:
    kept = entry["retention"][-1]
    if kept is None:
        return "it returned nothing without perturbation"
    interval = percents(entry["low"][-1], entry["high"][-1])
    text = f"keeps {percent(kept)} % ({interval}) at {entry['level'][-1]:g}"
    if entry["half"] is not None:
        text += f"; less than half from {entry['half']:g} on"
    return text
