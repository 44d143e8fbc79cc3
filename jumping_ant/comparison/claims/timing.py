"""The claims that rest on seconds, fixed beforehand in docs/measures-and-claims.md.

They are statements on a machine, and a family of their own: corrected with all others, they would
make every other verdict depend on a clock.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from jumping_ant.comparison.claims import findings
from jumping_ant.comparison.claims.evidence import Case, Compare, more_effort
from jumping_ant.comparison.claims.field import pairs
from jumping_ant.comparison.claims.findings import Finding, Sample
from jumping_ant.comparison.claims.statements import Row, Table
from jumping_ant.comparison.results import AgentResults

Scaling = Mapping[str, Mapping[int, NDArray[np.float64]]]
"""By agent, the time of a unit of training [s], (num_seeds,), by number of threads; {} if not
timed."""

ARTICLES_STEPS = {"sac": 100_000, "dqn": 1_000_000}  # [control steps] of training
HEAVY = "{0} is computationally heavy: it needs more training seconds than {1} to learn anything."


def table(scaling: Scaling) -> Table:
    """Return which agents, in the order of their labels in the texts, and the claims on them."""
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
    """Ask whether the first agent trains for longer than the second per control step (`more`)."""
    samples = case.samples(
        lambda agent: Sample(
            agent.label, 1000 * (agent.budgets("seconds") / agent.budgets("env_steps"))
        )
    )
    return findings.independent("Training time per control step [ms]", *samples, case.params)


def longer_training(case: Case) -> Finding | None:
    """Ask whether the first agent trains for longer than the second in all (`more`).

    There is no finding for other budgets than the article's: the answer would be ours.
    """
    if any(agent.block.max_env_steps != ARTICLES_STEPS[agent.algorithm] for agent in case.agents):
        return None
    samples = case.samples(lambda agent: Sample(agent.label, agent.budgets("seconds")))
    return findings.independent("Training time [s]", *samples, case.params)


def more_speed_up(scaling: Scaling) -> Compare:
    """Ask whether all cores speed the first agent's training up more than the second's.

    The speed-up is the time of a unit of training on one thread over that on all cores, seed by
    seed, and is tested as in `more`. There is no finding for agents that are not timed.
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
