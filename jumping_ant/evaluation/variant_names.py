"""The versions of an agent's policies: the published one, and its variants.

`jumping_ant.evaluation.variants` makes the variants.
"""

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.catalogue import ALGORITHMS, row
from jumping_ant.params.blocks import ActionParams, EvaluateParams

PUBLISHED = "published"
DISCRETE = ("signed", "three", "rounded_full", "rounded")
NAMES = ("final", *DISCRETE, "best_sample")
# Claims compare a policy with these of its variants (docs/measures-and-claims.md).
IN_CLAIMS = ("signed", "rounded_full", "rounded", "best_sample")


def of_agent(agent: AgentBlock) -> tuple[str, ...]:
    """Return the names of the variants that each seed of an agent has."""
    actions = getattr(agent, "actions", None)  # rhythms have none
    chooses_torques = isinstance(actions, ActionParams) and actions.kind == "torques"
    return names(agent.algorithm, chooses_torques)


def names(algorithm: str, chooses_torques: bool) -> tuple[str, ...]:
    """Return the names of the variants of an algorithm's policies."""
    known = ALGORITHMS[algorithm]
    discrete = DISCRETE if known.has_rounded and chooses_torques else ()
    return ("final", *discrete, *(("best_sample",) if known.has_best_sample else ()))


def num_episodes(agent: AgentBlock, evaluate: EvaluateParams) -> dict[str, int]:
    """Return on how many held-out episodes each version of a seed's policy is played."""
    in_claims = [*IN_CLAIMS]
    if row(agent).has_best_sample:
        in_claims.append("final")  # the centre beside the best sample
    if not agent.is_baseline:
        in_claims.append(PUBLISHED)
    return {
        version: evaluate.episodes if version in in_claims else evaluate.baseline_episodes
        for version in (PUBLISHED, *NAMES)
    }
