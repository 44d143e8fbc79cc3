"""The tables of validation: what the snapshots returned of which a seed published the best.

`jumping_ant.training.seed_files` writes them; whoever reads them does so here.
"""

from collections.abc import Iterable
from pathlib import Path

from jumping_ant.base import tables
from jumping_ant.base.paths import Paths
from jumping_ant.base.tables import Column
from jumping_ant.training import curves

COLUMNS = {
    "env_steps": curves.COUNT,
    "episodes": Column(low=1, high=1e7, is_whole=True),
    "return_mean": Column(),
    "return_std": Column(low=0),
}
"""Columns after those of the owner; a row for each snapshot that came into question."""


def published_return(root: Path, agent: str, seed: int) -> float:
    """Return the mean return of a seed's published policy in validation."""
    path = Paths(root).agent(agent).seed(seed).validation
    table = tables.read(path, f"train@{agent}", curves.owner(agent, seed), COLUMNS)
    return float(table["return_mean"].max())


def best_first(root: Path, agent: str, seeds: Iterable[int]) -> list[int]:
    """Return seeds of an agent, the one whose policy did best in validation first."""
    return sorted(seeds, key=lambda seed: -published_return(root, agent, seed))
