"""Every algorithm that an agent of `params.yaml` may name."""

from typing import get_args

from jumping_ant.agents.algorithm import AgentBlock, Algorithm
from jumping_ant.agents.evolution import algorithms as evolution
from jumping_ant.agents.imitation import algorithms as imitation
from jumping_ant.agents.off_policy import algorithms as off_policy
from jumping_ant.agents.on_policy import algorithms as on_policy
from jumping_ant.agents.open_loop import algorithms as open_loop
from jumping_ant.agents.random import algorithms as random

ALGORITHMS: dict[str, Algorithm] = (
    random.ALGORITHMS
    | open_loop.ALGORITHMS
    | off_policy.ALGORITHMS
    | on_policy.ALGORITHMS
    | evolution.ALGORITHMS
    | imitation.ALGORITHMS
)


def row(agent: AgentBlock) -> Algorithm:
    """Return the row of an agent's algorithm."""
    return ALGORITHMS[agent.algorithm]


def demonstrated() -> set[str]:
    """Return the trainers whose agents learn from demonstrations."""
    settings = [each.settings for each in ALGORITHMS.values()]
    return {
        get_args(each.model_fields["trainer"].annotation)[0]
        for each in settings
        if each.learns_from_demonstrations
    }
