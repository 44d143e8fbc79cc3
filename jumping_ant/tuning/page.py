"""A study as one page, which opens from disk without a network (see `jumping_ant.report.frame`)."""

import json
import math
import warnings
from collections.abc import Mapping, Sequence
from itertools import accumulate
from pathlib import Path
from typing import Any

import optuna
import plotly.graph_objects as go
from optuna import visualization
from optuna.importance import PedAnovaImportanceEvaluator

from jumping_ant.looks import looks
from jumping_ant.looks.wording import interval, number, p_value
from jumping_ant.report import frame
from jumping_ant.report.charts import finish
from jumping_ant.tuning.outcome import GOOD, expected_best

FOLDER = Path(__file__).parent
MOST_SLICES = 3  # in a row
ROW = 310  # [pixels] height of a row of slices
COLOURS = {"complete": "#0072B2", "pruned": "#B0B7C3"}
SIGNS = {"better": "supported", "worse": "refuted", "equivalent": "equivalent"}


def build(
    found: Mapping[str, Any],
    table: Sequence[dict[str, Any]],
    shown: optuna.Study,
    unit: str,
    control: Sequence[float],
) -> str:
    """Return the page's HTML.

    Args:
        found: The summary, with the verdict if there is one.
        table: The trials.
        shown: The trials as a study in memory (`outcome.as_complete`).
        unit: What a trial's value is.
        control: Values of random draws, if there are any: of a control, its own.
    """
    charts = {"history": _history(table, unit, control)}
    if found["importance"]:
        charts |= _analyses(shown, unit)
    if "returns" in found:
        charts["fresh"] = _fresh(found["returns"])
    drawn = ", drawn at random" if "draws" in found else ""
    context = {
        "title": f"Settings of {found['agent']}: {found['trials']} trials{drawn}",
        "found": found,
        "verdict": _verdict(found) if "returns" in found else "",
        "sign": SIGNS.get(found.get("verdict", ""), "inconclusive"),
        "table": [row | {"changes": _listed(row)} for row in sorted(table, key=_rank)],
        "control": control,
        "budgets": _budgets(found, control),
    }
    return frame.render(FOLDER, context, charts)


def _rank(row: Mapping[str, Any]) -> tuple[bool, float]:
    """Return the place of a trial: complete ones first, the best of them above."""
    return row["state"] != "complete", -float(row["value"] or -math.inf)


def _listed(row: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {value}" for name, value in json.loads(row["settings"]).items())


def _verdict(found: Mapping[str, Any]) -> str:
    num_seeds = len(found["returns"]["before"])
    low_high = interval(found["low"], found["high"], num_seeds)
    is_timed = found["rules"]["target_return"] is not None
    unit, difference = (" s", "saved seconds") if is_timed else ("", "a difference")
    return (
        f"{number(found['after'])}{unit} with the settings of trial {found['best_trial']}, "
        f"{number(found['before'])}{unit} with its own: {difference} of "
        f"{number(found['difference'])} {low_high} "
        f"(rank test, {num_seeds} seeds each: p = {p_value(found['p'])})."
    )


def _budgets(found: Mapping[str, Any], control: Sequence[float]) -> list[tuple[str, str, str]]:
    """Return rows of the trials' number, the best after them, and what random draws would find."""
    rows = []
    for num, best in found["best_after"].items():
        draws = number(expected_best(control, int(num))) if int(num) <= len(control) else ""
        rows.append((num, number(best), draws))
    return rows


def _history(table: Sequence[Mapping[str, Any]], unit: str, control: Sequence[float]) -> go.Figure:
    """Draw each trial's value, and the best so far."""
    figure = go.Figure()
    for state, colour in COLOURS.items():
        own = [row for row in table if row["state"] == state and row["value"]]
        figure.add_scatter(
            x=[row["trial"] + 1 for row in own],
            y=[float(row["value"]) for row in own],
            name=state,
            mode="markers",
            marker={"color": colour, "size": 8},
            text=[f"trial {row['trial']} {row['reason']}" for row in own],
            hovertemplate="%{text}: %{y:,.0f}<extra></extra>",
        )
    complete = [row for row in table if row["state"] == "complete"]
    figure.add_scatter(
        x=[row["trial"] + 1 for row in complete],
        y=list(accumulate((float(row["value"]) for row in complete), max)),
        name="best so far",
        mode="lines",
        line={"color": COLOURS["complete"], "shape": "hv"},
        hovertemplate="%{y:,.0f}",
    )
    if control:
        figure.add_scatter(
            x=list(range(1, len(control) + 1)),
            y=[expected_best(control, num) for num in range(1, len(control) + 1)],
            name="random draws, expected best",
            mode="lines",
            line={"color": looks.INK, "dash": "dash"},
            hovertemplate="%{y:,.0f}",
        )
    figure.update_xaxes(title="Number of trials")
    figure.update_yaxes(title=unit)
    return finish(figure, 380)


def _analyses(shown: optuna.Study, unit: str) -> dict[str, go.Figure]:
    """Return Optuna's charts of what the settings do."""
    evaluator = PedAnovaImportanceEvaluator(target_quantile=GOOD)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that few trials say little
        importance = visualization.plot_param_importances(shown, evaluator=evaluator)
        figures = {
            "importance": finish(importance, 380, title=None, showlegend=False),
            "parallel": finish(
                visualization.plot_parallel_coordinate(shown, target_name=unit),
                420,
                top=60,
                title=None,
            ),
        }
        names = list(shown.best_params)
        for place in range(0, len(names), MOST_SLICES):
            own = names[place : place + MOST_SLICES]
            chart = visualization.plot_slice(shown, params=own, target_name=unit)
            for axis in chart.select_xaxes({"type": "log"}):
                axis.dtick = "D2"  # 1, 2 and 5 times a power of ten: all nine overlap
            figures[f"slice_{place // MOST_SLICES}"] = finish(chart, ROW, title=None)
    for figure in figures.values():
        figure.update_layout(width=None)
    return figures


def _fresh(returns: Mapping[str, Sequence[float]]) -> go.Figure:
    """Draw the fresh seeds."""
    figure = go.Figure()
    for which, label in (("before", "own settings"), ("after", "tuned")):
        figure.add_scatter(
            x=list(returns[which]),
            y=[label] * len(returns[which]),
            mode="markers",
            marker={"size": 9, "opacity": 0.75, "color": COLOURS["complete"]},
            text=[f"fresh seed {seed + 1}" for seed in range(len(returns[which]))],
            hovertemplate="%{text}: %{x:,.0f}<extra></extra>",
        )
    figure.update_xaxes(title="Return", rangemode="tozero")
    figure.update_yaxes(autorange="reversed", type="category", showgrid=False)
    return finish(figure, 200, showlegend=False)
