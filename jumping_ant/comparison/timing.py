"""What training took in seconds: the numbers and claims of `results/speed.json`.

docs/measures-and-claims.md fixed the claims beforehand. They are statements on a machine, and a
family of their own: corrected with all others, they would make every verdict depend on a clock.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.comparison import comparison
from jumping_ant.comparison.claims import findings, verdicts
from jumping_ant.comparison.claims.evidence import Case, Compare, more_effort
from jumping_ant.comparison.claims.field import pairs
from jumping_ant.comparison.claims.findings import Finding, Sample
from jumping_ant.comparison.claims.statements import Row, Table
from jumping_ant.comparison.results import AgentResults, merged
from jumping_ant.params.model import Params

Scaling = Mapping[str, Mapping[int, NDArray[np.float64]]]
"""By agent, the time of a unit of training [s], (num_seeds,), by number of threads; {} if not
timed."""

ARTICLES_STEPS = {"sac": 100_000, "dqn": 1_000_000}  # [control steps] of training
HEAVY = "{0} is computationally heavy: it needs more training seconds than {1} to learn anything."


def summarize(
    params: Params,
    results: Mapping[str, AgentResults],
    compared: Mapping[str, Any],
    scaling: Scaling,
) -> dict[str, Any]:
    """Return the agents' seconds, what they returned after equal ones, and the claims on them.

    Args:
        params: All parameters.
        results: Of each agent, with seconds in its curves.
        compared: The content of `results/comparison.json`, which has the returns.
        scaling: What a unit of each agent's training takes, by number of threads.
    """
    equal, early = comparison.at_equal_budgets(results, "seconds", params.compare.confidence)
    agents = {
        name: {"train_seconds": float(agent.budgets("seconds").mean())} | early.get(name, {})
        for name, agent in results.items()
    }
    together = merged(compared, {"agents": agents})["agents"]
    episodes = params.training.evaluation_episodes
    return {
        "agents": agents,
        "equal_seconds": equal,
        "pareto_seconds": comparison.front(results, together, "seconds"),
        "claims": verdicts.check(results, params.compare, episodes, table(scaling)),
    }


def table(scaling: Scaling) -> Table:
    """Return the claims."""
    parallel = Row(
        15,
        "The population of {0} parallelises: all cores of this machine speed it up more than {1}, "
        "which updates one policy.",
        more_speed_up(scaling),
    )
    return (
        (pairs("sac", "dqn"), (
            Row(3, "{0} takes more time to train than {1}, per control step.", longer_step),
            Row(3, "{0} takes more time to train than {1}, in all, as the article trains them.",
                longer_training),
        )),
        (pairs("pgpe", "sac"), (Row(10, HEAVY, more_effort("seconds")), parallel)),
        (pairs("pgpe", "dqn"), (Row(10, HEAVY, more_effort("seconds", margin=True)), parallel)),
    )  # fmt: skip


def longer_step(case: Case) -> Finding:
    """Ask whether the first agent trains for longer than the second per control step."""
    samples = case.samples(
        lambda agent: Sample(
            agent.label, 1000 * (agent.budgets("seconds") / agent.budgets("env_steps"))
        )
    )
    return findings.independent("Training time per control step [ms]", *samples, case.params)


def longer_training(case: Case) -> Finding | None:
    """Ask whether the first agent trains for longer than the second in all.

    Only with the article's budgets: with others, the answer would be ours.
    """
    if any(agent.block.max_env_steps != ARTICLES_STEPS[agent.algorithm] for agent in case.agents):
        return None
    samples = case.samples(lambda agent: Sample(agent.label, agent.budgets("seconds")))
    return findings.independent("Training time [s]", *samples, case.params)


def more_speed_up(scaling: Scaling) -> Compare:
    """Ask whether all cores speed the first agent's training up more than the second's.

    The speed-up of a seed is the time of a unit of training on one thread over that on all cores.
    """

    def speed_up(agent: AgentResults) -> Sample:
        """Return how many times as fast each seed trains; NaN if there is only one core."""
        seconds = scaling[agent.name]
        cores, one = max(seconds), seconds[1]
        return Sample(agent.label, one / seconds[cores] if cores > 1 else np.full(len(one), np.nan))

    def compare(case: Case) -> Finding | None:
        if not all(scaling[agent.name] for agent in case.agents):
            return None
        axis = "Speed-up from one thread to all cores"
        return findings.independent(axis, *case.samples(speed_up), case.params)

    return compare
