"""The tables of an agent's held-out episodes, their means and those of its variants.

`jumping_ant.evaluation.evaluation` makes them; whoever reads them does so here. They are read as
`params.yaml` asks for them: each episode of each seed once.
"""

from pathlib import Path

import numpy as np

from jumping_ant.base import tables
from jumping_ant.base.paths import Paths
from jumping_ant.base.tables import EPISODE_SEED, SEED, Column, Table
from jumping_ant.evaluation import variant_names
from jumping_ant.evaluation.measures import MEASURES, TERM
from jumping_ant.evaluation.variant_names import PUBLISHED
from jumping_ant.params.model import Params
from jumping_ant.sim import rewards
from jumping_ant.sim.trajectory import Trajectory

QUANTITIES = ("length", *MEASURES, "survived")
COUNT = Column(low=1, high=1e6, is_whole=True)
EPISODE_KEYS = {"seed": SEED, "episode": SEED, "episode_seed": EPISODE_SEED}
"""What identifies an episode among those of its agent."""


def read(root: Path, params: Params, agent: str) -> Table:
    """Read an agent's held-out episodes, seed by seed as in `params.yaml`: (num_episodes,) each.

    NaN stands for the empty cells that `Column.can_be_empty` allows.
    """
    path, stage = Paths(root).agent(agent).episodes, f"evaluate@{agent}"
    table = tables.read(path, stage, {"agent": agent}, EPISODE_KEYS | _quantities(params))
    count = variant_names.num_episodes(params.agent(agent), params.evaluate)[PUBLISHED]
    blocks = {seed: params.evaluate.block(seed)[:count] for seed in params.seeds}
    asked = [(seed, i, block[i]) for seed, block in blocks.items() for i in range(count)]
    with tables.blamed(path, stage):
        return tables.exactly(table, asked, *EPISODE_KEYS)


def read_variants(root: Path, params: Params, agent: str) -> dict[str, Table]:
    """Read each variant's means over episodes, (num_seeds,) each, in the order of `params.yaml`."""
    path, stage = Paths(root).agent(agent).variants, f"evaluate@{agent}"
    counts = variant_names.num_episodes(params.agent(agent), params.evaluate)
    names = variant_names.of_agent(params.agent(agent))
    keys = {"seed": SEED, "variant": Column(words=names), "episodes": COUNT}
    table = tables.read(path, stage, {"agent": agent}, keys | _quantities(params, are_means=True))
    asked = [(seed, name, counts[name]) for name in names for seed in params.seeds]
    with tables.blamed(path, stage):
        ordered = tables.exactly(table, asked, *keys)
    return {
        name: {column: values[ordered["variant"] == name] for column, values in ordered.items()}
        for name in names
    }


def read_means(root: Path, params: Params, agent: str) -> Table:
    """Read the means of each seed that an agent was evaluated with, (num_seeds,) each."""
    path, stage = Paths(root).agent(agent).seed_means, f"evaluate@{agent}"
    columns = {"seed": SEED} | _quantities(params, are_means=True)
    return tables.read(path, stage, {"agent": agent}, columns)


def find(table: Table, agent: str, trajectory: Trajectory, path: Path) -> dict[str, float]:
    """Return the row of an agent's episodes that a trajectory, read from the path, shows."""
    given = {
        "seed": trajectory.seed,
        "episode": trajectory.episode,
        "length": len(trajectory.torques),
        "return": trajectory.episode_return,
    }
    found = np.logical_and.reduce([table[name] == value for name, value in given.items()])
    with tables.blamed(path, f"evaluate@{agent}"):
        if trajectory.agent != agent or not found.any():
            told = ", ".join(f"{name} {value:g}" for name, value in given.items())
            raise ValueError(
                f"given an episode of agent {trajectory.agent} ({told}), allowed: one of the "
                f"episodes.csv of agent {agent}"
            )
    return {name: float(column[found.argmax()]) for name, column in table.items()}


def _quantities(params: Params, are_means: bool = False) -> dict[str, Column]:
    """Return the columns of what is measured of an episode, or of the means over episodes."""
    terms = [TERM + name for name in rewards.active(params.env.reward)]
    columns = {name: measure.column for name, measure in MEASURES.items()}
    longest = params.env.max_episode_steps
    return {
        "length": Column(low=1, high=longest, is_whole=not are_means),
        "return": columns.pop("return"),
        **dict.fromkeys(terms if len(terms) > 1 else (), Column()),
        **columns,
        "survived": Column(low=0, high=1, is_whole=not are_means),
    }
