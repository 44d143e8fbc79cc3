"""What the claims compare: measurements of their agents, as samples of one number per seed."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from jumping_ant.comparison.claims import findings
from jumping_ant.comparison.claims.field import Field, settings
from jumping_ant.comparison.claims.findings import Efforts, Finding, Range, Sample
from jumping_ant.comparison.results import AgentResults
from jumping_ant.evaluation.episodes import PUBLISHED
from jumping_ant.media.style import number
from jumping_ant.params.blocks import CompareParams
from jumping_ant.training import curves

AXES = {
    "return": "Return",
    "flight": "Share of time in flight",
    "apex": "Apex of a jump [m]",
    "fluidity": "Fluidity (closer to 0 is more fluid)",
}
VERSIONS = {  # of policies: what their labels add
    PUBLISHED: "",
    "signed": ", two levels",
    "rounded_full": ", five commands",
    "rounded": ", five commands at half torque",
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
Key = Literal["returns", "fluidity", "relative_spread"]  # of margins, for differences


def more(*quantities: str, factor: float = 1.0, margin: Key | None = None) -> Compare:
    """Ask whether the first agent exceeds the second, times a factor, in every quantity."""

    def compare(case: Case) -> Finding:
        ends = _ends(case.params, margin) if margin else None
        return findings.both(
            [
                findings.independent(
                    AXES[name], *case.samples(_mean(name)), case.params, factor, ends
                )
                for name in quantities
            ]
        )

    return compare


def more_in_version(
    quantity: str, one: str, other: str, margin: Key, *, or_equal: bool = False
) -> Compare:
    """Ask whether one of `VERSIONS` of an agent's policies exceeds another, seed by seed.

    With `or_equal` the claim is only that it is not smaller by the margin (non-inferiority).
    """

    def compare(case: Case) -> Finding | None:
        (agent,) = case.agents
        if not {one, other} <= agent.variants.keys() | {PUBLISHED}:
            return None
        samples = _mean(quantity, one)(agent), _mean(quantity, other)(agent)
        ends = _ends(case.params, margin)
        if or_equal:
            return findings.paired(AXES[quantity], *samples, case.params, not_less_by=ends[1])
        return findings.paired(AXES[quantity], *samples, case.params, ends)

    return compare


def at_full_torque(compare: Compare) -> Compare:
    """Ask only of an agent whose amplitude is 1."""
    return lambda case: (
        compare(case) if settings(case.agents[0])["actions"]["amplitude"] == 1 else None
    )


def less_spread(case: Case) -> Finding:
    """Ask whether the first agent's return varies less over seeds than the second's."""
    samples, ends = case.samples(_mean("return")), _ends(case.params, "relative_spread")
    return findings.less_spread(AXES["return"], *samples, case.params, ends)


def more_effort(unit: curves.Unit, *, margin: bool = False) -> Compare:
    """Ask whether the first agent needs more than the second to learn anything, for good.

    A seed's effort lies between the last evaluation that does not exceed `Field.threshold` and the
    next one.
    """

    def compare(case: Case) -> Finding | None:
        threshold = case.field.threshold
        if threshold is None:
            return None
        axis = f"{UNITS[unit]} to a return above {number(threshold)} that lasts"
        first, second = (_effort(agent, unit, threshold) for agent in case.agents)
        ratio = case.params.margins.seconds
        ends = (1 / ratio, ratio) if margin else None
        return findings.more_effort(axis, first, second, case.params, ends)

    return compare


def fewer_steps(case: Case) -> Finding | None:
    """Ask whether the first agent needs fewer control steps than the second to learn anything."""
    return more_effort("env_steps")(replace(case, agents=case.agents[::-1]))


def _ends(params: CompareParams, margin: Key) -> Range:
    size: float = getattr(params.margins, margin)
    return -size, size


def _mean(quantity: str, version: str = PUBLISHED) -> Callable[[AgentResults], Sample]:
    """Measure the mean of a quantity over each seed's episodes."""
    return lambda agent: Sample(
        f"{agent.label}{VERSIONS[version]}",
        ({PUBLISHED: agent.quantities} | agent.variants)[version][quantity],
    )


def _effort(agent: AgentResults, unit: curves.Unit, threshold: float) -> Efforts:
    """Return each seed's effort until all evaluations exceed a threshold."""
    bounds = [curves.onset(curve, threshold, unit) for curve in agent.curves.values()]
    return Efforts(agent.label, np.array(bounds), agent.budgets(unit))
