"""Figures that compare the article's printed values with ours.

Each seed's first test is a thin line in its agent's colour (see `jumping_ant.media.style`), the
printed values are a bold one. The same numbers give the same bytes.
"""

import io
from collections.abc import Mapping

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from jumping_ant.article.reproduction import Reproduction, Trace
from jumping_ant.media.plotting import STYLES, entitle, render
from jumping_ant.media.style import INK, Look

PANELS = {
    "fitness_mean": "Mean of the population",
    "fitness_best": "Best of the population",
    "fitness_median": "Median of the population",
}
NUM_COLOURS = 48


def draw(reproduction: Reproduction, looks: Mapping[str, Look]) -> dict[str, Figure]:
    """Draw the figures of the agents that were tested; `looks` are by the agents' names."""
    with style.context(STYLES):
        figures = {
            agent: _draw_totals(agent, trace, looks[agent])
            for agent, trace in reproduction.totals.items()
        }
        if reproduction.fitness:
            figures["pgpe"] = _draw_fitness(reproduction.fitness, looks["pgpe"])
        return figures


def picture(figure: Figure) -> bytes:
    """Return a figure as a PNG with few colours, small enough for git."""
    with Image.open(io.BytesIO(render(figure, "png"))) as image:
        few = image.convert("RGB").quantize(NUM_COLOURS, dither=Image.Dither.NONE)
    content = io.BytesIO()
    few.save(content, format="PNG", optimize=True)
    return content.getvalue()


def _draw_totals(agent: str, trace: Trace, look: Look) -> Figure:
    figure = Figure(figsize=(6, 3.6), layout="constrained")
    axes = figure.subplots()
    _draw_trace(axes, trace, look)
    axes.set(xlabel="Control step of the test", ylabel="Total reward so far")
    axes.set_ylim(bottom=0)
    axes.legend(loc="upper left")
    title = f"{agent.upper()}, tested as in the article: each seed (thin), printed (bold)"
    return entitle(figure, title)


def _draw_fitness(fitness: Mapping[str, Trace], look: Look) -> Figure:
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    panels = figure.subplots(1, len(fitness))
    for axes, (name, trace) in zip(panels, fitness.items(), strict=True):
        _draw_trace(axes, trace, look)
        axes.set(xlabel="Generation", title=PANELS[name])
    panels[0].set_ylabel("Fitness (200 steps, less 1 a step)")
    panels[0].legend(loc="upper left")
    title = "PGPE's population: each seed (thin), printed (bold)"
    return entitle(figure, title)


def _draw_trace(axes: Axes, trace: Trace, look: Look) -> None:
    x = np.arange(1, trace.ours.shape[2] + 1)
    for number, seed in enumerate(trace.ours[:, 0]):
        name = "our seeds" if number == 0 else "_"
        axes.plot(x, seed, color=look.colour, linewidth=0.9, alpha=0.7, label=name)
    points = list(trace.printed), list(trace.printed.values())
    axes.plot(*points, color=INK, linewidth=2.4, marker="o", markersize=4, label="printed")
