"""The claims that rest on seconds, fixed beforehand in docs/claims.md.

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

# By agent, the time of a unit of training [s], (num_seeds,), by number of threads; {} if not timed.
Scaling = Mapping[str, Mapping[int, NDArray[np.float64]]]


def table(scaling: Scaling) -> Table:
    """Return which agents, in the order of their labels in the texts, and the claims on them."""
    return (
        (pairs("sac", "dqn"), (
            Row(3, "{0} takes more time to train than {1}, in all.", longer_training),
        )),
        (pairs("pgpe", "sac dqn"), (
            Row(10, "{0} is computationally heavy: it needs more training seconds than {1} to "
                "learn anything.", more_effort("seconds")),
            Row(15, "The population of {0} parallelises: all cores speed it up more than {1}, "
                "which updates one policy.", more_speed_up(scaling)),
        )),
    )  # fmt: skip


def longer_training(case: Case) -> Finding:
    """Ask whether the first agent trains for longer than the second, in seconds (as `more`)."""
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
