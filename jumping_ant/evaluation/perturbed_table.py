"""The table of an agent's perturbed episodes, `results/robustness/AGENT.csv`."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from jumping_ant.base import tables
from jumping_ant.base.paths import Paths
from jumping_ant.base.tables import EPISODE_SEED, SEED, Column
from jumping_ant.evaluation import perturbed
from jumping_ant.evaluation.perturbed import Case
from jumping_ant.params.model import Params
from jumping_ant.sim.perturbations import NAMES, NONE, Condition

DIGITS = 2  # of the returns
COLUMNS = {
    "perturbation": Column(words=(NONE.perturbation, *NAMES)),
    "level": Column(low=0),
    "seed": SEED,
    "episode_seed": EPISODE_SEED,
    "return": Column(),
}


def to_csv(agent: str, played: Sequence[Case], returns: Sequence[float]) -> str:
    """Return the table's content: whose episodes, under which conditions, and their returns."""
    rows = [
        {
            "agent": agent,
            "perturbation": case.condition.perturbation,
            "level": _exact(case.condition.level),
            "seed": case.seed,
            "episode_seed": case.start,
            "return": f"{value:.{DIGITS}f}",
        }
        for case, value in zip(played, returns, strict=True)
    ]
    return tables.to_csv(rows, ["agent", *COLUMNS])


def read(root: Path, params: Params, agent: str) -> dict[Condition, NDArray[np.float64]]:
    """Read each seed's mean return under each condition, (num_seeds,); {} if it was not played."""
    path, stage = Paths(root).perturbed(agent), f"robustness@{agent}"
    asked = list(perturbed.cases(params, agent))
    table = tables.read(path, stage, {"agent": agent}, COLUMNS, has_rows=bool(asked))
    if not asked:
        return {}
    with tables.blamed(path, stage):
        # As text, so that a message has all digits of a level that is missing.
        table["level"] = np.array([_exact(level) for level in table["level"]])
        keys = [
            (case.condition.perturbation, _exact(case.condition.level), case.seed, case.start)
            for case in asked
        ]
        returns = tables.exactly(table, keys, *list(COLUMNS)[:-1])["return"]
    means: dict[Condition, NDArray[np.float64]] = {}
    for condition in perturbed.conditions():
        count = len(params.seeds) * perturbed.num_episodes(params, condition)
        means[condition] = returns[:count].reshape(len(params.seeds), -1).mean(axis=1)
        returns = returns[count:]
    return means


def _exact(level: float) -> str:
    """Return the shortest decimal number that is read as a level: 1, 0.3, 0.3333333."""
    return np.format_float_positional(level, trim="-")
