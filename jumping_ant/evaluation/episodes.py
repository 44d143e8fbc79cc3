"""Which versions of its policies an agent plays on held-out episodes, and the resulting tables.

A version is the published policy or a variant (`jumping_ant.evaluation.variants` makes them). The
tables, which `jumping_ant.evaluation.evaluation` makes, are read as `params.yaml` asks for them:
each episode of each seed once.
"""

from pathlib import Path

import numpy as np

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.catalogue import row
from jumping_ant.base import tables
from jumping_ant.base.files import blamed
from jumping_ant.base.paths import Paths
from jumping_ant.base.tables import EPISODE_SEED, SEED, Column, Table
from jumping_ant.evaluation.measures import MEASURES, TERM
from jumping_ant.params.blocks import EvaluateParams
from jumping_ant.params.model import Params
from jumping_ant.sim import rewards
from jumping_ant.sim.trajectory import Trajectory

PUBLISHED = "published"
VARIANTS = ("final", "best_sample")

QUANTITIES = ("length", *MEASURES, "survived")
COUNT = Column(low=1, high=1e6, is_whole=True)
EPISODE_KEYS = {"seed": SEED, "episode": SEED, "episode_seed": EPISODE_SEED}
"""What identifies an episode among those of its agent."""


def variant_names(agent: AgentBlock) -> tuple[str, ...]:
    """Return the names of the variants that each seed of an agent has."""
    return VARIANTS if row(agent).has_best_sample else VARIANTS[:1]


def num_episodes(agent: AgentBlock, evaluate: EvaluateParams) -> dict[str, int]:
    """Return on how many held-out episodes each version of a seed's policy is played."""
    whole = [] if agent.is_baseline else [PUBLISHED]
    if row(agent).has_best_sample:
        whole += VARIANTS  # the centre beside the best sample
    return {
        version: evaluate.episodes if version in whole else evaluate.baseline_episodes
        for version in (PUBLISHED, *variant_names(agent))
    }


def read(root: Path, params: Params, agent: str) -> Table:
    """Read an agent's held-out episodes, seed by seed as in `params.yaml`: (num_episodes,) each.

    NaN stands for the empty cells that `Column.can_be_empty` allows.
    """
    path, stage = Paths(root).agent(agent).episodes, f"evaluate@{agent}"
    table = tables.read(path, stage, {"agent": agent}, EPISODE_KEYS | _quantities(params))
    count = num_episodes(params.agent(agent), params.evaluate)[PUBLISHED]
    blocks = {seed: params.evaluate.block(seed)[:count] for seed in params.seeds}
    asked = [(seed, i, block[i]) for seed, block in blocks.items() for i in range(count)]
    with blamed(stage, path):
        return tables.exactly(table, asked, *EPISODE_KEYS)


def read_variants(root: Path, params: Params, agent: str) -> dict[str, Table]:
    """Read each variant's means over episodes, (num_seeds,) each, in the order of `params.yaml`."""
    path, stage = Paths(root).agent(agent).variants, f"evaluate@{agent}"
    counts = num_episodes(params.agent(agent), params.evaluate)
    names = variant_names(params.agent(agent))
    keys = {"seed": SEED, "variant": Column(words=names), "episodes": COUNT}
    table = tables.read(path, stage, {"agent": agent}, keys | _quantities(params, are_means=True))
    asked = [(seed, name, counts[name]) for name in names for seed in params.seeds]
    with blamed(stage, path):
        ordered = tables.exactly(table, asked, *keys)
    return {
        name: {column: values[ordered["variant"] == name] for column, values in ordered.items()}
        for name in names
    }


def find(table: Table, agent: str, trajectory: Trajectory, path: Path) -> dict[str, float]:
    """Return the row of an agent's episodes that a trajectory, read from the path, shows."""
    shown = {
        "seed": trajectory.seed,
        "episode": trajectory.episode,
        "length": len(trajectory.torques),
        "return": trajectory.episode_return,
    }
    matches = np.logical_and.reduce([table[name] == value for name, value in shown.items()])
    with blamed(f"evaluate@{agent}", path):
        if trajectory.agent != agent or not matches.any():
            values = ", ".join(f"{name} {value:g}" for name, value in shown.items())
            raise ValueError(
                f"given an episode of agent {trajectory.agent} ({values}), allowed: one of the "
                f"episodes.csv of agent {agent}"
            )
    return {name: float(column[matches.argmax()]) for name, column in table.items()}


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
