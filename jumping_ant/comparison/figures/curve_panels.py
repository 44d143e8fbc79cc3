"""The figure of learning curves: one panel, or with many learners one for each family."""

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jumping_ant.comparison import charting
from jumping_ant.comparison.comparison import LearningCurve
from jumping_ant.comparison.figures import scales
from jumping_ant.comparison.results import AgentResults
from jumping_ant.looks import panels
from jumping_ant.looks.looks import Look


def draw(
    results: Mapping[str, AgentResults],
    curves: Mapping[str, LearningCurve],
    drawn: Mapping[str, Look],
    reference: str | None,
) -> Figure:
    """Draw the returns while learning; each family's panel names the baseline `reference`."""
    grouped = panels.panels({name: results[name].family for name in curves})
    height = 4 if len(grouped) == 1 else 0.9 + 2.2 * len(grouped)
    figure = Figure(figsize=(9, height), layout="constrained")
    rows = figure.subplots(len(grouped), 2, sharex="col", sharey=True, squeeze=False)
    for row, (family, names) in zip(rows, grouped.items(), strict=True):
        if family:
            _draw_family(row, {name: results[name] for name in names}, curves, drawn, reference)
            row[0].set_title(family.capitalize())
            row[1].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=9)
        else:
            for name in names:
                _draw_curve(row, results[name], curves[name], drawn[name])
            handles, labels = row[0].get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside lower center", ncols=min(5, len(labels)))
        row[0].set_ylabel(charting.LEARNING if len(grouped) == 1 else "Return")
    for axes, (time, label) in zip(rows[-1], charting.TIMES.items(), strict=True):
        scales.fit_time(axes, [getattr(curve, time) for curve in curves.values()])
        axes.set_xlabel(label)
    rows[-1][0].set_ylim(bottom=0)
    return figure


def _draw_family(
    row: Sequence[Axes],
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
            for axes in row:
                axes.axhline(level, color=drawn[name].colour, linewidth=0.8, label=label)
        else:
            _draw_curve(row, agent, curves[name], drawn[name])


def _draw_curve(row: Sequence[Axes], agent: AgentResults, curve: LearningCurve, look: Look) -> None:
    """Draw a curve with its interval, against control steps and against seconds."""
    returns = curve.returns
    for axes, x in zip(row, (curve.env_steps, curve.seconds), strict=True):
        axes.fill_between(x, returns.low, returns.high, color=look.colour, alpha=0.15, linewidth=0)
        axes.plot(
            x,
            returns.value,
            look.line,
            color=look.colour,
            marker="" if agent.is_baseline else look.marker,
            markersize=4,
            label=agent.label,
        )
