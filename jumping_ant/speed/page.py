"""What training took, on these machines, as one page: `results/speed.html`."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from jumping_ant.base import tables
from jumping_ant.base.files import read_json
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import charting
from jumping_ant.comparison.results import AgentResults
from jumping_ant.experiment.models import Params
from jumping_ant.looks import looks
from jumping_ant.looks.wording import number
from jumping_ant.report import frame, outcomes, sections
from jumping_ant.report.outcomes import Cell, Row

FOLDER = Path(__file__).parent


def build(
    root: Path, params: Params, results: Mapping[str, AgentResults], summary: Mapping[str, Any]
) -> str:
    """Return the page's HTML.

    Args:
        root: The project's folder, with the agents' `machines.json`.
        params: All parameters.
        results: Of each agent, with seconds in its curves.
        summary: Of `compare` and `speed` together (`summaries.merged`), with the claims of `speed`.
    """
    agents = sections.ordered(results, summary["agents"])
    drawn = looks.looks(charting.families(results))
    equal = summary["equal_seconds"]
    context = sections.context(params, agents, summary["claims"]) | {
        "title": "What training took",
        "times": _times(agents, summary["agents"]),
        "equal_seconds": "" if equal is None else number(equal),
        "machines": _machines(root, params),
    }
    charts = sections.figures(params, agents, summary, drawn, "seconds")
    return frame.render(FOLDER, context, charts)


def _times(results: Mapping[str, AgentResults], summary: Mapping[str, Any]) -> list[Row]:
    """Return the seconds of each agent's seeds, and its return after equal ones."""
    learners = charting.learners(results)

    def cells(name: str) -> list[Cell]:
        own, seconds = summary[name], results[name].budgets("seconds")
        spans = [own["train_seconds"], seconds.min(), seconds.max()]
        early = outcomes.estimate(own.get("return_at_equal_seconds"), own["seeds"])
        return [*(Cell(number(value)) for value in spans), *([early] if learners else [])]

    return [outcomes.row(agent, cells(name)) for name, agent in results.items()]


def _machines(root: Path, params: Params) -> list[dict[str, str]]:
    """Return the machines, with their versions, that policies were trained on."""
    found = {}
    for name in params.agents:
        path, stage = Paths(root).agent(name).machines, f"train@{name}"
        told = read_json(path, stage)
        for seed in map(str, params.seeds):
            with tables.blamed(path, stage):
                if not isinstance(told.get(seed), dict):
                    raise ValueError(f"given no machine of seed {seed}, allowed: that of each seed")
            own = dict(_flat(told[seed]))
            found[json.dumps(own)] = own
    return list(found.values())


def _flat(machine: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield what describes a machine, line by line; the versions are its last part."""
    for key, value in machine.items():
        if isinstance(value, Mapping):
            yield from _flat(value)
        else:
            yield key, str(value)
