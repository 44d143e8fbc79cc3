"""What the claims compare: measurements of their agents, as samples of one number per seed."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from jumping_ant.comparison.claims import findings
from jumping_ant.comparison.claims.field import Field
from jumping_ant.comparison.claims.findings import Finding, Sample
from jumping_ant.comparison.results import AgentResults
from jumping_ant.experiment import curves
from jumping_ant.looks.wording import number
from jumping_ant.params.blocks import CompareParams

AXES = {
    "return": "Return",
    "flight": "Share of time in flight",
    "apex": "Apex of a jump [m]",
    "fluidity": "Fluidity (closer to 0 is more fluid)",
}
PUBLISHED = "published"
VERSIONS = {  # of policies: what their labels add
    PUBLISHED: "",
    "rounded": ", rounded",
    "final": ", centre",
    "best_sample": ", best of its samples",
}
UNITS: dict[curves.Unit, str] = {"env_steps": "Control steps", "seconds": "Training seconds"}


@dataclass(frozen=True)
class Case:
    """The agents that a claim compares, the field that they belong to, and the parameters."""

    agents: tuple[AgentResults, ...]
    field: Field
    params: CompareParams

    def samples(self, measure: Callable[[AgentResults], Sample]) -> tuple[Sample, Sample]:
        """Return a measurement of each of two agents."""
        first, second = self.agents
        return measure(first), measure(second)


Compare = Callable[[Case], Finding | None]  # None where the run lacks what it needs


def more(*quantities: str, factor: float = 1.0) -> Compare:
    """Ask whether the first agent exceeds the second, times a factor, in each quantity.

    In each: the probability that a seed of the first does, and the rank test of it, or a sign-flip
    test where one agent's seeds all agree (`findings.independent`). All of them must hold
    (`findings.both`).
    """
    return lambda case: findings.both(
        [
            findings.independent(AXES[name], *case.samples(_mean(name)), case.params, factor)
            for name in quantities
        ]
    )


def more_in_version(quantity: str, one: str, other: str) -> Compare:
    """Ask whether one version of an agent's policies exceeds the other, seed by seed.

    The mean difference of the same seeds, and the sign-flip test (`findings.paired`). The versions
    are keys of `VERSIONS`; there is no finding if the agent lacks one.
    """

    def compare(case: Case) -> Finding | None:
        (agent,) = case.agents
        if not {one, other} <= agent.variants.keys() | {PUBLISHED}:
            return None
        samples = _mean(quantity, one)(agent), _mean(quantity, other)(agent)
        return findings.paired(AXES[quantity], *samples, case.params)

    return compare


def less_spread(case: Case) -> Finding:
    """Ask whether the first agent's return varies less than the second's.

    The difference in spread over seeds relative to the median, and the permutation test of it
    (`findings.less_spread`).
    """
    return findings.less_spread(AXES["return"], *case.samples(_mean("return")), case.params)


def more_effort(unit: curves.Unit) -> Compare:
    """Ask whether the first agent needs more than the second to learn anything, for good.

    A seed's effort is what it spends, in `unit`, up to the evaluation from which on all exceed
    `Field.threshold`. A seed that never gets there counts with its whole budget, a lower bound, so
    the rank test is the one with bounds (Gehan 1965; `findings.more_effort`). There is no finding
    without a random agent, which gives the threshold.
    """

    def compare(case: Case) -> Finding | None:
        threshold = case.field.threshold
        if threshold is None:
            return None
        axis = f"{UNITS[unit]} to a return above {number(threshold)} that lasts"
        samples = case.samples(lambda agent: _effort(agent, unit, threshold))
        return findings.more_effort(axis, *samples, case.params)

    return compare


def fewer_steps(case: Case) -> Finding | None:
    """Ask whether the first agent needs fewer control steps than the second to learn anything.

    It is `more_effort` of the agents in reverse order.
    """
    return more_effort("env_steps")(replace(case, agents=case.agents[::-1]))


def only_beside(algorithm: str, compare: Compare) -> Compare:
    """Ask only where an agent of an algorithm is in the run, too."""
    return lambda case: compare(case) if case.field.of(algorithm) else None


def _mean(quantity: str, version: str = PUBLISHED) -> Callable[[AgentResults], Sample]:
    """Measure the mean of a quantity over each seed's episodes."""
    return lambda agent: Sample(
        f"{agent.label}{VERSIONS[version]}",
        ({PUBLISHED: agent.quantities} | agent.variants)[version][quantity],
    )


def _effort(agent: AgentResults, unit: curves.Unit, threshold: float) -> Sample:
    """Return each seed's effort until all evaluations exceed a threshold, or its whole budget."""
    rows = [curves.sustained(curve, threshold) for curve in agent.curves.values()]
    efforts = [
        curve[unit][-1 if row is None else row]
        for curve, row in zip(agent.curves.values(), rows, strict=True)
    ]
    return Sample(agent.label, np.array(efforts), np.array([row is not None for row in rows]))
