"""The measurements of every agent, one number per seed, and what stages have computed of them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.agents import catalogue
from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.families import Family
from jumping_ant.base.tables import Table
from jumping_ant.evaluation import episodes
from jumping_ant.params.model import Params
from jumping_ant.training import curves
from jumping_ant.training.curves import Unit

Array = NDArray[np.float64]

QUANTITIES = ("return", "peak_height", "torque_change")  # first in a summary


@dataclass(frozen=True)
class AgentResults:
    """All measurements of one agent."""

    name: str
    block: AgentBlock
    # Means over each seed's episodes, (num_seeds,); NaN for a seed without a value.
    quantities: dict[str, Array]
    curves: dict[int, Table]  # as `curves.read_all` returns it, seeds in the same order
    episodes: Table = field(default_factory=dict)  # as `episodes.read` returns it
    # The same means of variants of each seed's policy, by variant.
    variants: dict[str, dict[str, Array]] = field(default_factory=dict)
    demonstrator: str = ""  # the agent that it imitates; empty if it imitates none
    validation_steps: int = 0  # at most, by which a seed's published policy was chosen

    @property
    def algorithm(self) -> str:
        """Return the agent's algorithm."""
        return self.block.algorithm

    @property
    def is_baseline(self) -> bool:
        """Return whether the agent learns nothing."""
        return self.block.is_baseline

    @property
    def family(self) -> Family:
        """Return the family of the agent's algorithm."""
        return catalogue.row(self.block).family

    @property
    def label(self) -> str:
        """Return the agent's display name."""
        return catalogue.label(self.name, self.algorithm)

    def budgets(self, unit: Unit) -> Array:
        """Return what each seed's whole training took, (num_seeds,)."""
        return np.array([curve[unit][-1] for curve in self.curves.values()])


def load(
    root: Path,
    params: Params,
    read_curves: Callable[[Path, Params, str], dict[int, Table]] = curves.read_all,
) -> dict[str, AgentResults]:
    """Read the results of all agents, in the order of `params.yaml`.

    With `curves.read_timed`, curves have `seconds`, too, which differ from machine to machine.
    """
    results = {}
    for name, block in params.agents.items():
        played = episodes.read(root, params, name)
        results[name] = AgentResults(
            name=name,
            block=block,
            quantities=seed_means(played, params.seeds) | _falls(played, params.seeds),
            curves=read_curves(root, params, name),
            episodes=played,
            variants=episodes.read_variants(root, params, name),
            demonstrator=params.demonstrator(block),
            validation_steps=_validation_steps(params),
        )
    return results


def merged(compared: Mapping[str, Any], timed: Mapping[str, Any]) -> dict[str, Any]:
    """Return the summaries `comparison.json` and `speed.json` as one; either may be empty."""
    agents, costs = compared.get("agents", {}), timed.get("agents", {})
    claims = [*compared.get("claims", []), *timed.get("claims", [])]
    together = {name: own | costs.get(name, {}) for name, own in agents.items()}
    return {**compared, **timed, "agents": together, "claims": claims} if compared else {}


def deciding_p(claim: Mapping[str, Any]) -> float:
    """Return the adjusted p value by which a claim of a summary is decided, or is not."""
    decides = "p_equivalence_adjusted" if claim["verdict"] == "equivalent" else "p_adjusted"
    return float(claim[decides])


def seed_means(table: Table, seeds: Sequence[int]) -> dict[str, Array]:
    """Return each quantity's mean over the episodes of each seed; NaN where all cells are empty.

    Not those of `seeds.csv`: pandas sums in another order, so that last digits differ.
    """

    def mean(values: Array) -> float:
        known = values[~np.isnan(values)]
        return float(known.mean()) if len(known) else float("nan")

    others = (name for name in table if name not in (*episodes.EPISODE_KEYS, *QUANTITIES))
    return {
        name: np.array([mean(table[name][table["seed"] == seed]) for seed in seeds])
        for name in (*QUANTITIES, *others)
    }


def _validation_steps(params: Params) -> int:
    """Return the most control steps by which a seed's published policy may be chosen."""
    own = params.training
    if own.publish == "final":
        return 0
    episodes = own.evaluations * own.evaluation_episodes + own.finalists * own.finalist_episodes
    return episodes * params.env.max_episode_steps


def _falls(table: Table, seeds: Sequence[int]) -> dict[str, Array]:
    """Return what each seed returns in episodes without a fall, and its falls per 1,000 jumps."""
    survivors, rates = [], []
    for seed in seeds:
        own = {name: table[name][table["seed"] == seed] for name in ("return", "jumps", "survived")}
        has_survived, jumps = own["survived"] == 1, own["jumps"].sum()
        survivors.append(own["return"][has_survived].mean() if has_survived.any() else np.nan)
        rates.append(1000 * (~has_survived).sum() / jumps if jumps else np.nan)
    return {"survivors_return": np.array(survivors), "falls_per_1000_jumps": np.array(rates)}
