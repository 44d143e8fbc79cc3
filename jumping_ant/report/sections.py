"""Sections that pages share, in either unit of training: learning curves, costs, tested claims."""

from collections.abc import Mapping, Sequence
from typing import Any

import plotly.graph_objects as go

from jumping_ant.comparison import charting, comparison
from jumping_ant.comparison.results import AgentResults
from jumping_ant.experiment.curves import Unit
from jumping_ant.experiment.models import Params
from jumping_ant.looks import style
from jumping_ant.looks.families import by_family
from jumping_ant.looks.style import Look
from jumping_ant.report import charts, contests, standings, statements


def ordered(
    results: Mapping[str, AgentResults], agents: Mapping[str, Any]
) -> dict[str, AgentResults]:
    """Return the agents by family, in each of them the best first."""
    families = charting.families(results)
    ranked = {name: families[name] for name in comparison.ranking(agents)}
    return {name: results[name] for members in by_family(ranked).values() for name in members}


def context(
    params: Params, results: Mapping[str, AgentResults], claims: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """Return what the templates of these sections, `pieces.html`, show."""
    families = charting.families(results)
    return {
        "families": list(by_family(families)) if style.is_crowded(families) else [""],
        "panels": list(style.panels(families)),
        "imitates": "imitation" in families.values(),
        "statements": statements.read(claims, len(params.seeds)),
        "verdicts": statements.count(claims),
        "signs": statements.SIGNS,
        "level": f"{params.compare.levels[0]:.2g}",
        "seeds": len(params.seeds),
    }


def figures(
    params: Params,
    results: Mapping[str, AgentResults],
    summary: Mapping[str, Any],
    drawn: Mapping[str, Look],
    unit: Unit,
) -> dict[str, go.Figure]:
    """Return the charts of these sections, by their places; `summary` has costs and claims."""
    found: dict[str, go.Figure] = {}
    if charting.learners(results):
        found |= _learning(params, results, summary, drawn, unit)
        found["cost"] = standings.cost(results, summary, unit, drawn)
    by_label = {agent.label: drawn[name] for name, agent in results.items()}
    for index, entry in enumerate(summary["claims"]):
        found[f"claim_{index}"] = contests.claim(entry, by_label, params.seeds)
    return found


def _learning(
    params: Params,
    results: Mapping[str, AgentResults],
    summary: Mapping[str, Any],
    drawn: Mapping[str, Look],
    unit: Unit,
) -> dict[str, go.Figure]:
    """Return the chart of learning curves, or of many learners one for each family."""
    curves = comparison.learning_curves(results, params.compare)
    grouped = style.panels(charting.families(results))
    named = comparison.best_baseline(results, summary["agents"]) if len(grouped) > 1 else None
    return {
        f"learning_{number}": charts.learning(
            {name: results[name] for name in names}, curves, unit, drawn, named
        )
        for number, names in enumerate(grouped.values())
    }
