"""A project of four agents whose report tests read, and the charts of a report."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from small_project import write_perturbed

from jumping_ant.base.files import PROJECT_ROOT, write_json
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import claims, comparison, retention
from jumping_ant.comparison.results import load
from jumping_ant.params.claims import of_project
from jumping_ant.params.model import Params

AGENTS = {"random": "random", "dqn": "dqn", "sac": "sac", "pgpe": "pgpe"}
SEEDS = [3, 1, 7, 5]
FILM = {"width": 64, "height": 64, "fps": 10, "seconds": 1.0}


def charts(html: str) -> dict:
    data = re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.S)
    assert data
    return json.loads(data[1])


def write_summaries(root: Path, params: Params, kept: Callable[[int], float]) -> dict[str, Any]:
    """Write and return the comparison, and robustness: a share is `kept`, by number of the seed."""
    write_perturbed(root, params, lambda name, condition, seed: kept(seed))
    played = retention.read(root, params)
    results = retention.with_groups(load(root, params), played)
    learned = claims.out_of_luck(results.values(), params.training.evaluation_episodes)
    asked = claims.on_seconds(of_project(PROJECT_ROOT, params), is_so=False)
    summary = comparison.summarize(results, params.compare)
    summary |= claims.judge(asked, results, params.compare, learned)
    write_json(Paths(root).comparison, summary)
    write_json(Paths(root).robustness, retention.summarize(played, params.compare.confidence))
    return summary
