"""Names of the variants of an agent's policies, which `jumping_ant.evaluation.variants` makes."""

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.params.blocks import ActionParams

NAMES = ("final", "rounded", "best_sample")
# Algorithms of the claims that compare a policy with such variants (docs/claims.md).
ROUNDED = ("sac", "pgpe")
SAMPLED = ("pgpe",)


def of_agent(agent: AgentBlock) -> tuple[str, ...]:
    """Return the names of the variants that each seed of an agent has."""
    actions = getattr(agent, "actions", None)  # rhythms have none
    chooses_torques = isinstance(actions, ActionParams) and actions.kind == "torques"
    return names(agent.algorithm, chooses_torques)


def names(algorithm: str, chooses_torques: bool) -> tuple[str, ...]:
    """Return the names of the variants of an algorithm's policies."""
    rounded = ("rounded",) if algorithm in ROUNDED and chooses_torques else ()
    return ("final", *rounded, *(("best_sample",) if algorithm in SAMPLED else ()))
