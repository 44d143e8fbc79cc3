"""Every algorithm that an agent of `params.yaml` may name."""

from jumping_ant.agents.algorithm import AgentBlock, Algorithm
from jumping_ant.agents.baselines import algorithms as baselines
from jumping_ant.agents.evolution import algorithms as evolution
from jumping_ant.agents.imitation import algorithms as imitation
from jumping_ant.agents.off_policy import algorithms as off_policy
from jumping_ant.agents.on_policy import algorithms as on_policy

ALGORITHMS: dict[str, Algorithm] = (
    baselines.ALGORITHMS
    | off_policy.ALGORITHMS
    | on_policy.ALGORITHMS
    | evolution.ALGORITHMS
    | imitation.ALGORITHMS
)


def row(agent: AgentBlock) -> Algorithm:
    """Return the row of an agent's algorithm."""
    return ALGORITHMS[agent.algorithm]


def label(name: str, algorithm: str) -> str:
    """Return an agent's name to print: a learning algorithm's label, other names as given."""
    own = ALGORITHMS[algorithm]
    return own.label if name == algorithm and not own.is_baseline else name


def demonstrated() -> set[str]:
    """Return the algorithms whose agents learn from demonstrations."""
    return {name for name, row in ALGORITHMS.items() if row.settings.learns_from_demonstrations}
