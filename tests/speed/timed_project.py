"""What `speed` reads of a small project, and computes."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jumping_ant.comparison import comparison
from jumping_ant.comparison.results import AgentResults, load
from jumping_ant.experiment import curves, summaries
from jumping_ant.experiment.models import Params
from jumping_ant.speed import page, seconds


@dataclass(frozen=True)
class Timed:
    """A project's folder, its results with their seconds, and their summaries."""

    root: Path
    params: Params
    results: dict[str, AgentResults]
    compared: dict[str, Any]
    seconds: dict[str, Any]

    @property
    def summary(self) -> dict[str, Any]:
        return summaries.merged(self.compared, self.seconds)

    def page(self) -> str:
        return page.build(self.root, self.params, self.results, self.summary)


def read(root: Path, params: Params) -> Timed:
    results = load(root, params, curves.read_timed)
    compared = comparison.summarize(results, params.compare)
    found = seconds.summarize(root, params, results, compared)
    return Timed(root, params, results, compared, found)
