"""What pages share: a frame, and sections in either unit of training.

Pages open from disk without a network: charts, their library, styles and pictures are embedded.
The sections are learning curves, costs and tested claims, whose templates are in `pieces.html`.
"""

import base64
import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from jumping_ant.agents.families import by_family
from jumping_ant.comparison import comparison
from jumping_ant.comparison.claims import verdicts
from jumping_ant.comparison.results import AgentResults
from jumping_ant.media import style
from jumping_ant.media.style import Look
from jumping_ant.params.model import Params
from jumping_ant.report import charting, charts, head_to_head, leaderboard

FOLDER = Path(__file__).parent


def ordered(
    results: Mapping[str, AgentResults], agents: Mapping[str, Any]
) -> dict[str, AgentResults]:
    """Return the agents by family, in each of them the best first."""
    ranked = {name: results[name].family for name in comparison.ranking(agents)}
    return {name: results[name] for members in by_family(ranked).values() for name in members}


def context(
    params: Params, results: Mapping[str, AgentResults], claims: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """Return what the templates of the sections show."""
    families = charting.families(results)
    return {
        "families": list(by_family(families)) if style.is_crowded(families) else [""],
        "panels": list(style.panels(families)),
        "imitates": "imitation" in families.values(),
        "statements": head_to_head.statements(claims, len(params.seeds)),
        "verdicts": head_to_head.count(claims),
        "signs": head_to_head.SIGNS,
        "level": f"{verdicts.LEVEL:.2g}",
        "seeds": len(params.seeds),
    }


def figures(
    params: Params,
    results: Mapping[str, AgentResults],
    summary: Mapping[str, Any],
    drawn: Mapping[str, Look],
) -> dict[str, go.Figure]:
    """Return the sections' charts, by their places; `summary` has costs and claims.

    Learning curves are one chart, or of many learners one for each family.
    """
    by_place: dict[str, go.Figure] = {}
    if charting.learners(results):
        curves = comparison.learning_curves(results, params.compare)
        grouped = style.panels(charting.families(results))
        named = comparison.best_baseline(results, summary["agents"]) if len(grouped) > 1 else None
        for number, names in enumerate(grouped.values()):
            shown = {name: results[name] for name in names}
            by_place[f"learning_{number}"] = charts.learning(shown, curves, drawn, named)
        by_place["cost"] = leaderboard.cost(results, summary, drawn)
    by_label = {agent.label: drawn[name] for name, agent in results.items()}
    for index, entry in enumerate(summary["claims"]):
        by_place[f"claim_{index}"] = head_to_head.claim(entry, by_label, params.seeds)
    return by_place


def render(
    folder: Path,
    context: Mapping[str, Any],
    figures: Mapping[str, go.Figure],
    scripts: Sequence[str] = ("charts.js",),
) -> str:
    """Return the HTML of a page.

    Args:
        folder: The folder of its `template.html`, which extends `frame.html`.
        context: What the template shows.
        figures: Each chart by its place in the template, which skips missing ones.
        scripts: The files of this folder that the page runs, besides the charts' library.
    """
    plotly, *others = [get_plotlyjs(), *map(_text, scripts)]
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([folder, FOLDER]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("template.html").render(
        context,
        charts={name: json.loads(figure.to_json()) for name, figure in figures.items()},
        security_policy=_security_policy(plotly, *others),
        style=_text("style.css"),
        plotly=plotly,
        scripts=others,
    )


def _text(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")


def _security_policy(*scripts: str) -> str:
    """Return what browsers may do with the page: run these scripts, and ask nobody for anything."""
    digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()) for script in scripts]
    allowed = " ".join(f"'sha256-{digest.decode()}'" for digest in digests)
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; "
        "img-src data: blob:; media-src 'self' file:; frame-src 'self' file:; base-uri 'none'; "
        "form-action 'none'"
    )
