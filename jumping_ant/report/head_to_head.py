"""The report's charts of who beats whom: all pairs of agents, and the claims, also as text."""

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import plotly.graph_objects as go

from jumping_ant.media import style
from jumping_ant.media.style import percent, percents
from jumping_ant.report.charts import LOG_AXIS, SHARES, SYMBOLS, finish
from jumping_ant.report.outcome import Outcome, is_long

MOST_IN_A_WIDE_MATRIX = 8  # agents whose pairs have room for their intervals
NARROW = 27  # [pixels] side of a cell that shows no interval
CLAIM_HEIGHT = 215  # [pixels]
SIGNS = {"supported": "\u2713", "refuted": "\u2717", "equivalent": "\u2248", "inconclusive": "?"}
OWN = "Questions of our own"  # claims that test no statement of the article


def improvement(outcome: Outcome) -> go.Figure:
    """Draw the probability that a seed of one agent returns more than one of another."""
    ranked, pairs = outcome.ranked, outcome.summary["probability_of_improvement"]
    chances = [[pairs.get(f"{one}>{other}") for other in ranked] for one in ranked]
    has_room = len(ranked) <= MOST_IN_A_WIDE_MATRIX
    labels = [outcome.results[name].label for name in ranked]
    figure = go.Figure()
    figure.add_heatmap(
        x=labels,
        y=labels,
        z=[[one["p"] if one else None for one in row] for row in chances],
        text=[[_chance(one, has_room, "<br>") for one in row] for row in chances],
        customdata=[[_chance(one, True, " %, interval ") for one in row] for row in chances],
        hovertemplate="%{y} returns more than %{x}: %{customdata} %<extra></extra>",
        **SHARES,
    )
    figure.update_xaxes(title="... than this one", side="top", showgrid=False, tickangle=-90)
    figure.update_yaxes(title="This one returns more ...", autorange="reversed", showgrid=False)
    return finish(figure, 180 + (44 if has_room else NARROW) * len(labels))


def improvement_width(num_agents: int) -> int:
    """Return the least width of the matrix with so many agents [pixels]."""
    return 160 + (52 if num_agents <= MOST_IN_A_WIDE_MATRIX else NARROW) * num_agents


def _chance(chance: Mapping[str, float] | None, with_interval: bool, separator: str) -> str:
    """Return a chance in per cent, with its interval if it has one; empty for none."""
    if chance is None:
        return ""
    if not with_interval or chance["low"] == chance["high"]:
        return percent(chance["p"])
    return f"{percent(chance['p'])}{separator}{percents(chance['low'], chance['high'])}"


def claim(outcome: Outcome, plot: Mapping[str, Any]) -> go.Figure:
    """Draw the evidence that a claim was judged by, its `plot`."""
    looks = {agent.label: outcome.looks[name] for name, agent in outcome.results.items()}
    figure = go.Figure()
    if plot.get("paired"):
        labels = [*plot["values"], None]
        pairs = [(*pair, None) for pair in zip(*plot["values"].values(), strict=True)]
        figure.add_scatter(
            x=list(chain(*pairs)),
            y=labels * len(pairs),
            mode="lines",
            line={"color": style.PAIR, "width": 1},
            hoverinfo="skip",
        )
    for label, values in plot["values"].items():
        look = looks[label.partition(", ")[0]]  # "SAC" or "SAC, rounded"
        filled = SYMBOLS[look.marker]
        hollow = f"{filled.removesuffix('-open')}-open"  # where the value is only a bound
        reached = plot.get("reached", {}).get(label, [True] * len(values))
        figure.add_scatter(
            x=values,
            y=[label] * len(values),
            mode="markers",
            marker={
                "color": look.colour,
                "symbol": [filled if is_reached else hollow for is_reached in reached],
                "size": 9,
                "opacity": 0.75,
            },
            text=[
                f"seed {seed}" if is_reached else f"seed {seed}, which never got there"
                for seed, is_reached in zip(outcome.params.seeds, reached, strict=False)
            ],
            hovertemplate="%{text}: %{x:,.4~g}<extra></extra>",
        )
    known = [value for values in plot["values"].values() for value in values if value is not None]
    figure.update_xaxes(
        title={"text": plot["axis"], "font": {"size": 12}},
        **(LOG_AXIS if is_long(known) else {"rangemode": "tozero"}),
    )
    ends = [len(plot["values"]) - 0.5, -0.5]
    figure.update_yaxes(range=ends, type="category", showgrid=False)
    return finish(figure, CLAIM_HEIGHT, showlegend=False)


def statements(entries: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the statements that were tested, in the order of their claims.

    Each has a `title`, the `counts` of its verdicts, and its `claims` with their `index` of all.
    """
    grouped = dict[str, list[dict[str, Any]]]()
    for index, entry in enumerate(entries):
        grouped.setdefault(entry["statement"] or OWN, []).append({**entry, "index": index})
    return [
        {"title": title, "counts": count(members), "claims": members}
        for title, members in grouped.items()
    ]


def count(entries: Sequence[Mapping[str, Any]]) -> dict[str, int]:
    """Return the number of claims with each verdict that occurs."""
    counts = Counter(entry["verdict"] for entry in entries)
    return {verdict: counts[verdict] for verdict in SIGNS if verdict in counts}
