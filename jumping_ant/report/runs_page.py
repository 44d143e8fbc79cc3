"""A page on anybody's runs: returns, learning curves, pairs, and claims with their seeds."""

from collections.abc import Mapping
from html import escape
from typing import Any

from plotly.offline import get_plotlyjs

from jumping_ant.comparison.results import AgentResults
from jumping_ant.params.blocks import CompareParams
from jumping_ant.params.model import Params
from jumping_ant.report import charts, head_to_head, leaderboard
from jumping_ant.report.outcome import Outcome

CONFIG = {"displayModeBar": False}


def build(
    agents: Mapping[str, AgentResults], compare: CompareParams, summary: Mapping[str, Any]
) -> str:
    """Return the page's HTML, which opens without a network.

    Args:
        agents: The measurements of the agents.
        compare: Of intervals.
        summary: What `comparison.summarize` and `claims.judge` return.
    """
    seeds = list(next(iter(agents.values())).curves)
    blocks = {name: agent.block for name, agent in agents.items()}
    params = Params.model_construct(seeds=seeds, agents=blocks, compare=compare)
    outcome = Outcome(params, agents, summary)
    returns = leaderboard.ranking(outcome).update_layout(showlegend=False)
    returns.update_xaxes(title="Return")
    learning = charts.learning(outcome, agents).update_yaxes(title="Return")
    learning.update_xaxes(title="Steps")
    parts = [
        _part("Returns", returns),
        _part("Learning curves", learning),
        _part("Which returns more", head_to_head.improvement(outcome)),
    ]
    for entry in summary["claims"]:
        title = f"{entry['verdict'].capitalize()}: {entry['text']}"
        parts.append(_part(title, head_to_head.claim(outcome, entry["plot"]), entry["evidence"]))
    about = f"Interquartile means over {len(seeds)} seeds, with their intervals; a run returns what"
    return (
        "<!doctype html><html lang='en'><meta charset='utf-8'><title>Runs compared</title>"
        f"<style>body {{ font: 15px {charts.FONT}; max-width: 900px; margin: 2em auto }}</style>"
        f"<script>{get_plotlyjs()}</script><h1>Runs compared</h1>"
        f"<p>{about} its last row says.</p>{''.join(parts)}</html>\n"
    )


def _part(title: str, figure: Any, text: str = "") -> str:
    drawn = figure.to_html(full_html=False, include_plotlyjs=False, config=CONFIG)
    return f"<h2>{escape(title)}</h2><p>{escape(text)}</p>{drawn}"
