"""The figure of who beats whom: a matrix of probabilities, the best agent first."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from jumping_ant.comparison import charting
from jumping_ant.comparison.results import AgentResults
from jumping_ant.looks.style import CHANCES, INK

COLOURS = LinearSegmentedColormap.from_list("chance", CHANCES)


def draw(results: Mapping[str, AgentResults], summary: Mapping[str, Any]) -> Figure:
    """Draw the probability that a seed of a row's agent returns more than one of a column's."""
    labels, chances = charting.duels(results, summary)
    has_room = charting.has_room(len(labels))
    side = (0.7 if has_room else 0.4) * len(labels)
    figure = Figure(figsize=(max(5.5, 1.6 + side), 1.9 + side), layout="constrained")
    axes = figure.subplots()
    shades = np.array([[one["p"] if one else np.nan for one in row] for row in chances])
    axes.imshow(shades, cmap=COLOURS, vmin=0, vmax=1)
    for row, column in np.argwhere(~np.isnan(shades)):
        text = charting.chance_text(chances[row][column], has_room)
        axes.text(column, row, text, ha="center", va="center", fontsize=8, color=INK)
    axes.set_xticks(range(len(labels)), labels, rotation=90 if len(labels) > 4 else 0)
    axes.set_yticks(range(len(labels)), labels)
    axes.tick_params(length=0, top=True, labeltop=True, bottom=False, labelbottom=False)
    axes.spines[:].set_visible(False)
    axes.grid(False)
    axes.xaxis.set_label_position("top")
    axes.set_xlabel(charting.LOSER, labelpad=8)
    axes.set_ylabel(charting.WINNER)
    return figure
