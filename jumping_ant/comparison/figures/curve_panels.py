"""The figure of learning curves: one panel, or with many learners one for each family."""

from collections.abc import Mapping
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jumping_ant.comparison import charting
from jumping_ant.comparison.comparison import LearningCurve
from jumping_ant.comparison.figures import scales
from jumping_ant.comparison.results import AgentResults
from jumping_ant.experiment.curves import Unit
from jumping_ant.looks import style
from jumping_ant.looks.style import Look


def draw(
    results: Mapping[str, AgentResults],
    curves: Mapping[str, LearningCurve],
    drawn: Mapping[str, Look],
    reference: str | None,
    unit: Unit = "env_steps",
) -> Figure:
    """Draw the returns while learning; each family's panel names the baseline `reference`."""
    grouped = style.panels({name: results[name].family for name in curves})
    height = 4 if len(grouped) == 1 else 0.9 + 2.2 * len(grouped)
    figure = Figure(figsize=(9, height), layout="constrained")
    rows = figure.subplots(len(grouped), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axes, (family, names) in zip(rows, grouped.items(), strict=True):
        if family:
            _draw_family(axes, {name: results[name] for name in names}, curves, drawn, reference)
            axes.set_title(family.capitalize())
            axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=9)
        else:
            for name in names:
                _draw_curve(axes, results[name], curves[name], drawn[name])
            handles, labels = axes.get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside lower center", ncols=min(5, len(labels)))
        axes.set_ylabel(charting.LEARNING if len(grouped) == 1 else "Return")
    scales.fit_time(rows[-1], [curve.trained for curve in curves.values()])
    rows[-1].set_xlabel(charting.BUDGETS[unit])
    rows[-1].set_ylim(bottom=0)
    return figure


def _draw_family(
    axes: Axes,
    agents: Mapping[str, AgentResults],
    curves: Mapping[str, LearningCurve],
    drawn: Mapping[str, Look],
    reference: str | None,
) -> None:
    """Draw a family's curves and, as thin lines, the baselines, of which one is named."""
    for name, agent in agents.items():
        if agent.is_baseline:
            level = curves[name].returns.value[-1]
            label = agent.label if name == reference else "_"
            axes.axhline(level, color=drawn[name].colour, linewidth=0.8, label=label)
        else:
            _draw_curve(axes, agent, curves[name], drawn[name])


def _draw_curve(axes: Axes, agent: AgentResults, curve: LearningCurve, look: Look) -> None:
    """Draw a curve with its interval."""
    x, returns = curve.trained, curve.returns
    axes.fill_between(x, returns.low, returns.high, color=look.colour, alpha=0.15, linewidth=0)
    marker = "" if agent.is_baseline else look.marker
    style: Any = {"color": look.colour, "marker": marker, "markersize": 4}
    axes.plot(x, returns.value, look.line, label=agent.label, **style)
