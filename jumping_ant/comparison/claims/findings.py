"""The evidence on one claim, before the correction for the number of claims.

Each function here makes one kind of comparison and describes it in words: of two agents, a policy
and its variant, two spreads, two efforts of which some are only bounds, or several of these at
once.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.comparison import sample_sizes
from jumping_ant.comparison.estimates import (
    Estimate,
    bounded_pair_scores,
    estimate,
    estimate_iqm,
    estimate_mean,
    mean_pair_score,
    pair_scores,
    relative_spread,
)
from jumping_ant.comparison.hypothesis_tests import (
    Significance,
    joint,
    rank_test,
    sign_test,
    spread_test,
)
from jumping_ant.looks import wording
from jumping_ant.looks.wording import number
from jumping_ant.params.blocks import CompareParams

Array = NDArray[np.float64]
NO_PREFERENCE = 0.5  # a probability of improvement that favours neither side
UNDECIDED = Significance("none", 1.0, 1.0)


@dataclass(frozen=True)
class Finding:
    """An effect, its significance, and the data to plot."""

    evidence: str  # the numbers, as text
    name: str  # description of the effect
    effect: Estimate | None  # with its interval; None if there is nothing to compare
    no_effect: float  # where the claim would be neither right nor wrong; it is right above
    tested: Significance  # the test of no effect
    num_seeds: int  # of the smaller sample
    seeds_needed: Callable[[float, float], int | None]  # at a level and power; None: too many
    plot: Mapping[str, Any]  # `axis` and, by label, `values`: one number per seed

    @property
    def side(self) -> float:
        """Return a value above 0 if the effect lies on the claimed side, below 0 if opposite."""
        return float(self.effect.value - self.no_effect) if self.effect else 0.0


@dataclass(frozen=True)
class Sample:
    """One number per seed, and the label of the agent, or of the version of its policy."""

    label: str
    values: Array  # shape (num_seeds,); NaN where a seed has none
    is_exact: NDArray[np.bool_] | bool = True  # whether each is a value, no lower bound

    @property
    def known(self) -> Array:
        """Return the values of the seeds that have one."""
        return self.values[~np.isnan(self.values)]


def independent(
    quantity: str, first: Sample, second: Sample, params: CompareParams, factor: float = 1.0
) -> Finding:
    """Compare two agents: does a seed of the first exceed `factor` times one of the second?

    Seeds that all agree, such as those of a search that always finds the same policy, are no more
    evidence than one: the other agent's seeds are then compared with a constant.
    """
    x, y = first.known, factor * second.known
    plot = _plot(quantity, first, second)
    if not (len(x) and len(y)):
        return _nothing(quantity, plot)
    if len(x) > 1 and (np.ptp(x) == 0 or np.ptp(y) == 0):
        return _with_a_constant(quantity, first, second, factor, params)
    effect = mean_pair_score(pair_scores(np.sort(x), np.sort(y)), params)
    times = f"{factor:g} times " if factor != 1 else ""
    evidence = (
        f"{quantity}: {_iqm(first, params)}, {_iqm(second, params)}; a seed of {first.label} "
        f"exceeds {times}one of {second.label} with probability {_show(effect, len(x))}"
        f"{_left_out(first, second)}"
    )
    return Finding(
        evidence,
        f"probability that a seed of {first.label} exceeds {times}one of {second.label}",
        effect,
        NO_PREFERENCE,
        rank_test(x, y, params.seed),
        min(len(x), len(y)),
        lambda level, power: sample_sizes.for_rank_test(float(effect.value), level, power),
        plot,
    )


def paired(quantity: str, first: Sample, second: Sample, params: CompareParams) -> Finding:
    """Compare two versions of the same seeds: is the first one larger on average over seeds?"""
    differences = first.values - second.values
    differences = differences[~np.isnan(differences)]
    plot = {**_plot(quantity, first, second), "paired": True}
    if not len(differences):
        return _nothing(quantity, plot)
    effect = estimate_mean(differences, params.confidence)
    evidence = (
        f"{quantity}: {_iqm(first, params)}, {_iqm(second, params)}; mean difference of the same "
        f"seeds {_show(effect, len(differences))}{_left_out(first, second)}"
    )
    return Finding(
        evidence,
        f"mean of {first.label} less {second.label}, seed by seed",
        effect,
        0.0,
        sign_test(differences, params.seed),
        len(differences),
        lambda level, power: sample_sizes.for_sign_test(differences, level, power),
        plot,
    )


def _with_a_constant(
    quantity: str, first: Sample, second: Sample, factor: float, params: CompareParams
) -> Finding:
    """Compare two agents of which at least one has the same value in every seed."""
    x, y = first.known, factor * second.known
    alike = [own.label for own in (first, second) if np.ptp(own.known) == 0]
    varies = len(alike) == 1
    differences = x - y[0] if np.ptp(y) == 0 else x[0] - y
    effect = estimate_mean(differences, params.confidence)
    evidence = (
        f"{quantity}: {_iqm(first, params)}, {_iqm(second, params)}; mean difference "
        f"{_show(effect, len(differences))}; all seeds of {' and '.join(alike)} are the same policy"
    )
    return Finding(
        evidence,
        f"mean of {first.label} less {second.label}",
        effect,
        0.0,
        sign_test(differences, params.seed) if varies else UNDECIDED,
        len(differences) if varies else 1,
        lambda level, power: (
            sample_sizes.for_sign_test(differences, level, power) if varies else None
        ),
        _plot(quantity, first, second),
    )


def less_spread(quantity: str, first: Sample, second: Sample, params: CompareParams) -> Finding:
    """Compare the spread over seeds, relative to the median: does the first one have less?"""
    x, y = first.values, second.values

    def excess(own: Array, other: Array, axis: int = -1) -> Array:
        return relative_spread(other, axis) - relative_spread(own, axis)

    plot = _plot(quantity, first, second)
    if 0 in (np.median(x), np.median(y)):
        return _nothing(quantity, plot)
    effect = estimate(excess, [x, y], params)
    spreads = ", ".join(
        f"{sample.label} {number(relative_spread(sample.values))} (worst seed "
        f"{number(sample.values.min())}, median {number(np.median(sample.values))})"
        for sample in (first, second)
    )
    return Finding(
        f"{quantity}, mean distance from the median, relative to it: {spreads}; "
        f"{second.label} less {first.label}: {_show(effect, len(x))}",
        f"relative spread of {second.label} less that of {first.label}",
        effect,
        0.0,
        spread_test(x, y, params.seed),
        min(len(x), len(y)),
        lambda level, power: sample_sizes.for_spread_test(x, y, level, power),
        plot,
    )


def more_effort(quantity: str, first: Sample, second: Sample, params: CompareParams) -> Finding:
    """Compare efforts of which some are lower bounds: does a seed of the first need more?"""
    x, y = first.values, second.values
    x_exact, y_exact = (np.full(own.values.shape, own.is_exact) for own in (first, second))
    effect = mean_pair_score(bounded_pair_scores(x, x_exact, y, y_exact), params)
    efforts = ", ".join(
        f"{sample.label} {number(np.median(sample.values))} "
        f"({exact.sum()} of {len(exact)} seeds got there)"
        for sample, exact in ((first, x_exact), (second, y_exact))
    )
    plot = _plot(quantity, first, second)
    return Finding(
        f"median {quantity.lower()}, a seed that never got there counting with its whole "
        f"budget: {efforts}; a seed of {first.label} needs more than one of {second.label} with "
        f"probability {_show(effect, len(x))}",
        f"probability that a seed of {first.label} needs more than one of {second.label}",
        effect,
        NO_PREFERENCE,
        rank_test(x, y, params.seed, x_exact, y_exact),
        min(len(x), len(y)),
        lambda level, power: sample_sizes.for_rank_test(float(effect.value), level, power),
        {**plot, "reached": {first.label: x_exact.tolist(), second.label: y_exact.tolist()}},
    )


def both(findings: Sequence[Finding]) -> Finding:
    """Return the finding on a claim that holds only if all of several findings do.

    Its effect is that of the least significant one. On different sides, they decide nothing.
    """
    tested = joint([finding.tested for finding in findings])
    decisive = next(finding for finding in findings if finding.tested == tested)
    if len({np.sign(finding.side) for finding in findings}) > 1:
        decisive = min(findings, key=lambda finding: finding.side)
        tested = replace(tested, p=1.0)

    def seeds_needed(level: float, power: float) -> int | None:
        numbers = [finding.seeds_needed(level, power) for finding in findings]
        known = [needed for needed in numbers if needed is not None]
        return max(known) if len(known) == len(numbers) else None

    evidence = "; and ".join(finding.evidence for finding in findings)
    return replace(decisive, evidence=evidence, tested=tested, seeds_needed=seeds_needed)


def _nothing(quantity: str, plot: Mapping[str, Any]) -> Finding:
    evidence = f"{quantity}: no seed has a value that can be compared"
    return Finding(evidence, quantity, None, 0.0, UNDECIDED, 0, lambda level, power: None, plot)


def _plot(axis: str, *samples: Sample) -> dict[str, Any]:
    """Return the plot data; a seed without a value is None, so that seeds keep their positions."""
    values = {
        sample.label: [None if np.isnan(value) else float(value) for value in sample.values]
        for sample in samples
    }
    return {"axis": axis, "values": values}


def _left_out(*samples: Sample) -> str:
    missing = [
        f"{np.isnan(sample.values).sum()} of {sample.label}"
        for sample in samples
        if np.isnan(sample.values).any()
    ]
    return f"; seeds without a value are left out: {', '.join(missing)}" if missing else ""


def _iqm(sample: Sample, params: CompareParams) -> str:
    known = sample.known
    return f"{sample.label} {_show(estimate_iqm(known, params.confidence), len(known))}"


def _show(effect: Estimate, num_seeds: int) -> str:
    return wording.estimate(effect.value, effect.low, effect.high, num_seeds)
