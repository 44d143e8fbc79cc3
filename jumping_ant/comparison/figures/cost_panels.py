"""The figure of what returns cost, in control steps or in training seconds."""

from collections.abc import Mapping
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jumping_ant.comparison import charting
from jumping_ant.comparison.comparison import COSTS, FRONTS
from jumping_ant.comparison.figures import scales
from jumping_ant.comparison.results import AgentResults
from jumping_ant.experiment.curves import Unit
from jumping_ant.looks.style import INK, Look


def draw(
    results: Mapping[str, AgentResults],
    summary: Mapping[str, Any],
    drawn: Mapping[str, Look],
    reference: str | None,
    unit: Unit = "env_steps",
) -> Figure:
    """Draw the learners' returns against their costs; the legend names the baseline `reference`."""
    height = 4 + 0.15 * len(charting.learners(results))
    figure = Figure(figsize=(9, height), layout="constrained")
    axes = figure.subplots()
    _draw_agents(axes, results, summary["agents"], COSTS[unit], drawn, reference)
    _draw_front(axes, results, summary, unit)
    axes.set_xlabel(charting.BUDGETS[unit])
    axes.set_ylabel(charting.RETURN)
    axes.set_ylim(bottom=0)
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6, fontsize=9)
    return figure


def _draw_agents(
    axes: Axes,
    results: Mapping[str, AgentResults],
    agents: Mapping[str, Any],
    cost: str,
    drawn: Mapping[str, Look],
    reference: str | None,
) -> None:
    """Draw each learner as a point with its interval, and each baseline as a line."""
    for name, agent in results.items():
        look, own = drawn[name], agents[name]["return"]
        if agent.is_baseline:
            label = agent.label if name == reference else "_"
            axes.axhline(own["iqm"], color=look.colour, linewidth=0.8, label=label)
        else:
            place = [agents[name][cost]]
            axes.plot(place * 2, [own["low"], own["high"]], color=look.colour, alpha=0.5)
            point: Any = {"color": look.colour, "linestyle": "", "markersize": 7}
            axes.plot(place, [own["iqm"]], look.marker, label=agent.label, **point)
    scales.fit_costs(axes, [agents[name][cost] for name in charting.learners(results)])


def _draw_front(
    axes: Axes, results: Mapping[str, AgentResults], summary: Mapping[str, Any], unit: Unit
) -> None:
    """Draw the greatest return at each cost, with the names of the agents that reach it."""
    costs, returns = charting.front(results, summary, unit)
    axes.step(costs, returns, where="post", color=INK, linewidth=1.2, zorder=1)
    offset: Any = {"xytext": (-6, 6), "textcoords": "offset points", "ha": "right"}
    for name, x, y in zip(summary[FRONTS[unit]], costs, returns, strict=False):  # one corner more
        axes.annotate(results[name].label, (x, y), fontsize=9, **offset)
