"""The figure of what returns cost: against control steps, and against training seconds."""

from collections.abc import Mapping
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jumping_ant.judging.comparison import FRONTS
from jumping_ant.judging.results import AgentResults
from jumping_ant.showing import scales
from jumping_ant.words.looks import INK, Look

COSTS = {  # keys of an agent's cost, and the axis's label
    "env_steps": "Training budget [control steps]",
    "train_seconds": "Training time per seed [s]",
}


def draw(
    results: Mapping[str, AgentResults],
    summary: Mapping[str, Any],
    drawn: Mapping[str, Look],
    reference: str | None,
    title: str,
) -> Figure:
    """Draw the learners' returns against their costs, each with its Pareto front.

    Args:
        results: What `results.load` returns, with a learner at least.
        summary: What `comparison.summarize` returns.
        drawn: Each agent's look.
        reference: The baseline that the legend names.
        title: The figure's title.
    """
    num_learners = sum(not agent.is_baseline for agent in results.values())
    figure = Figure(figsize=(9, 4 + 0.15 * num_learners), layout="constrained")
    panels = figure.subplots(1, len(COSTS), sharey=True)
    for axes, (cost, label) in zip(panels, COSTS.items(), strict=True):
        _draw_panel(axes, results, summary["agents"], cost, drawn, reference)
        _draw_front(axes, results, summary["agents"], cost, summary[FRONTS[cost]])
        axes.set_xlabel(label)
    panels[0].set_ylabel("Return per held-out episode")
    panels[0].set_ylim(bottom=0)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6, fontsize=9)
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure


def _draw_panel(
    axes: Axes,
    results: Mapping[str, AgentResults],
    summary: Mapping[str, Any],
    cost: str,
    drawn: Mapping[str, Look],
    reference: str | None,
) -> None:
    """Draw each learner as a point with its interval, and each baseline as a line."""
    for name, agent in results.items():
        look, own = drawn[name], summary[name]["return"]
        if agent.is_baseline:
            label = agent.label if name == reference else "_"
            axes.axhline(own["iqm"], color=look.colour, linewidth=0.8, label=label)
        else:
            place = [summary[name][cost]]
            axes.plot(place * 2, [own["low"], own["high"]], color=look.colour, alpha=0.5)
            point: Any = {"color": look.colour, "linestyle": "", "markersize": 7}
            axes.plot(place, [own["iqm"]], look.marker, label=agent.label, **point)
    costs = [summary[name][cost] for name, agent in results.items() if not agent.is_baseline]
    scales.fit_costs(axes, costs)


def _draw_front(
    axes: Axes,
    results: Mapping[str, AgentResults],
    summary: Mapping[str, Any],
    cost: str,
    front: list[str],
) -> None:
    """Draw the greatest return at each cost, with the names of the agents that reach it."""
    costs = [summary[name][cost] for name in front]
    returns = [summary[name]["return"]["iqm"] for name in front]
    most = max(summary[name][cost] for name, agent in results.items() if not agent.is_baseline)
    ends = [*costs, most], [*returns, returns[-1]]
    axes.step(*ends, where="post", color=INK, linewidth=1.2, zorder=1)
    for name, place in zip(front, zip(costs, returns, strict=True), strict=True):
        axes.annotate(
            results[name].label, place, (-6, 6), textcoords="offset points", ha="right", fontsize=9
        )
