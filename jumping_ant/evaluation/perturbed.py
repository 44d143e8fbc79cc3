"""Which perturbed episodes an agent plays, and their table, `results/robustness/AGENT.csv`."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jumping_ant.agents.catalogue import row
from jumping_ant.base import tables
from jumping_ant.base.files import blamed
from jumping_ant.base.paths import Paths
from jumping_ant.base.tables import EPISODE_SEED, SEED, Column
from jumping_ant.params.model import Params
from jumping_ant.sim.levels import LEVELS
from jumping_ant.sim.perturbations import NAMES, NONE, Condition

EPISODES = 1  # of each seed at each level: the first of its held-out episodes
DIGITS = 2  # of the returns
COLUMNS = {
    "perturbation": Column(words=(NONE.perturbation, *NAMES)),
    "level": Column(low=0),
    "seed": SEED,
    "episode_seed": EPISODE_SEED,
    "return": Column(),
}


class Case(NamedTuple):
    """An episode to play."""

    condition: Condition
    seed: int  # of the policy
    start: int  # seed of the start state


def conditions() -> list[Condition]:
    """Return no perturbation, and every level of each."""
    levels = ((name, level) for name, row in LEVELS.items() for level in row.values)
    return [NONE, *(Condition(name, float(level)) for name, level in levels)]


def cases(params: Params, agent: str) -> Iterator[Case]:
    """Yield all episodes of an agent, seed by seed under each condition.

    Without perturbation they are more, as all that is kept is measured against them. Random actions
    play none: they hold no posture or rhythm that could be disturbed.
    """
    if not row(params.agent(agent)).is_perturbed:
        return
    for condition in conditions():
        count = params.evaluate.baseline_episodes if condition == NONE else EPISODES
        for seed in params.seeds:
            for start in params.evaluate.block(seed)[:count]:
                yield Case(condition, seed, start)


def to_csv(agent: str, returns: Mapping[Case, float]) -> str:
    """Return the table's content, a row for each episode."""
    rows = [
        {
            "agent": agent,
            "perturbation": case.condition.perturbation,
            "level": _exact(case.condition.level),
            "seed": case.seed,
            "episode_seed": case.start,
            "return": f"{value:.{DIGITS}f}",
        }
        for case, value in returns.items()
    ]
    return tables.to_csv(rows, ["agent", *COLUMNS])


def read(root: Path, params: Params, agent: str) -> dict[Condition, NDArray[np.float64]]:
    """Read each seed's mean return under each condition, (num_seeds,); {} if it was not played."""
    path, stage = Paths(root).perturbed(agent), f"robustness@{agent}"
    asked = list(cases(params, agent))
    table = tables.read(path, stage, {"agent": agent}, COLUMNS, has_rows=bool(asked))
    if not asked:
        return {}
    with blamed(stage, path):
        # As text, so that a message has all digits of a level that is missing.
        table["level"] = np.array([_exact(level) for level in table["level"]])
        keys = [
            (case.condition.perturbation, _exact(case.condition.level), case.seed, case.start)
            for case in asked
        ]
        returns = tables.exactly(table, keys, *list(COLUMNS)[:-1])["return"]
    played: dict[Condition, list[float]] = {case.condition: [] for case in asked}
    for case, value in zip(asked, returns, strict=True):
        played[case.condition].append(value)
    num_seeds = len(params.seeds)
    return {name: np.reshape(own, (num_seeds, -1)).mean(axis=1) for name, own in played.items()}


def _exact(level: float) -> str:
    """Return the shortest decimal number that is read as a level: 1, 0.3, 0.3333333."""
    return np.format_float_positional(level, trim="-")
