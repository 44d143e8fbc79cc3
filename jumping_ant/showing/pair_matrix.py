"""The figure of who beats whom: a matrix of probabilities, the best agent first."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from jumping_ant.judging import comparison
from jumping_ant.judging.results import AgentResults
from jumping_ant.words import looks
from jumping_ant.words.looks import INK
from jumping_ant.words.wording import percent, percents

COLOURS = LinearSegmentedColormap.from_list("chance", looks.CHANCES)


def draw(
    results: Mapping[str, AgentResults], summary: Mapping[str, Any], confidence: float
) -> Figure:
    """Draw the probability that a seed of a row's agent returns more than one of a column's.

    Args:
        results: What `results.load` returns.
        summary: What `comparison.summarize` returns.
        confidence: Confidence level of the intervals.
    """
    ranked = comparison.ranking(summary["agents"])
    pairs = summary["probability_of_improvement"]
    has_room = len(ranked) <= looks.MOST_IN_A_WIDE_MATRIX
    side = (0.7 if has_room else 0.4) * len(ranked)
    figure = Figure(figsize=(max(5.5, 1.6 + side), 1.9 + side), layout="constrained")
    axes = figure.subplots()
    chances = [[_chance(pairs.get(f"{one}>{other}")) for other in ranked] for one in ranked]
    axes.imshow(np.array(chances), cmap=COLOURS, vmin=0, vmax=1)
    for pair, chance in pairs.items():
        row, column = (ranked.index(name) for name in pair.split(">"))
        text = percent(chance["p"])
        if has_room and chance["low"] < chance["high"]:
            text += f"\n{percents(chance['low'], chance['high'])}"
        axes.text(column, row, text, ha="center", va="center", fontsize=8, color=INK)
    labels = [results[name].label for name in ranked]
    axes.set_xticks(range(len(ranked)), labels, rotation=90 if len(ranked) > 4 else 0)
    axes.set_yticks(range(len(ranked)), labels)
    axes.tick_params(length=0, top=True, labeltop=True, bottom=False, labelbottom=False)
    axes.spines[:].set_visible(False)
    axes.grid(False)
    axes.xaxis.set_label_position("top")
    axes.set_xlabel("... than this one", labelpad=8)
    axes.set_ylabel("This one returns more ...")
    title = "Probability of improvement [%]"
    if has_room:
        title += f", {100 * confidence:g} % interval (percentile bootstrap)"
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure


def _chance(pair: Mapping[str, float] | None) -> float:
    return pair["p"] if pair else float("nan")
