"""The evidence on one claim, before the correction for the number of claims.

Each function makes one kind of comparison and describes it in words. With a margin it also tests
whether the difference is smaller than the margin.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.comparison.estimates import (
    Estimate,
    estimate,
    estimate_iqm,
    estimate_mean,
    pairwise_median,
    probability_of_improvement,
    relative_spread,
)
from jumping_ant.comparison.hypothesis_tests import (
    OneSide,
    equivalence,
    excess_spread_test,
    rank_test,
    sign_test,
    spread_test,
)
from jumping_ant.media import style
from jumping_ant.media.style import number
from jumping_ant.params.blocks import CompareParams

Array = NDArray[np.float64]
NO_PREFERENCE = 0.5  # a probability of improvement that favours neither side

Range = tuple[float, float]


@dataclass(frozen=True)
class Margin:
    """The differences that are of no practical size, and the p value of one that is."""

    ends: Range
    p: float


@dataclass(frozen=True)
class Finding:
    """An effect, its significance, and the data to plot."""

    evidence: str  # the numbers, as text
    name: str  # description of the effect
    effect: Estimate | None  # with its interval; None if there is nothing to compare
    no_effect: float  # where the claim would be neither right nor wrong; it is right above
    test: str  # name of the test
    p: float  # two-sided, of no effect
    num_seeds: int  # of the smaller sample
    plot: Mapping[str, Any]  # `axis` and, by label, `values`: one number per seed
    margin: Margin | None = None

    @property
    def side(self) -> float:
        """Return a value above 0 if the effect lies on the claimed side, below 0 on the other."""
        return float(self.effect.value - self.no_effect) if self.effect else 0.0


@dataclass(frozen=True)
class Sample:
    """One number per seed, and the label of the agent, or of the version of its policy."""

    label: str
    values: Array  # shape (num_seeds,); NaN where a seed has none

    @property
    def known(self) -> Array:
        """Return the values of the seeds that have one."""
        return self.values[~np.isnan(self.values)]


@dataclass(frozen=True)
class Efforts:
    """What each seed spent until it got there, and the label of the agent."""

    label: str
    bounds: Array  # shape (num_seeds, 2): low < effort <= high, infinity for a seed that never did
    budgets: Array  # shape (num_seeds,)

    @property
    def spent(self) -> Array:
        """Return what each seed had spent when it was seen there, or its whole budget."""
        return np.minimum(self.bounds[:, 1], self.budgets)

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Return whether each seed got there."""
        return np.isfinite(self.bounds[:, 1])


def independent(
    quantity: str,
    first: Sample,
    second: Sample,
    params: CompareParams,
    factor: float = 1.0,
    ends: Range | None = None,
) -> Finding:
    """Compare two agents: does a seed of the first exceed `factor` times one of the second?

    The ends of a margin are differences.
    """
    x, y = first.known, factor * second.known
    plot = _plot(quantity, first, second)
    if not (len(x) and len(y)):
        return _nothing(quantity, plot, ends)
    effect = probability_of_improvement(x, y, params)
    times = f"{factor:g} times " if factor != 1 else ""
    evidence = (
        f"{quantity}: {_iqm(first, params)}, {_iqm(second, params)}; a seed of {first.label} "
        f"exceeds {times}one of {second.label} with probability {_show(effect, len(x))}"
    )
    if times and second.known.min() > 0:
        ratio = estimate(pairwise_median(np.divide), [x, second.known], params)
        evidence += f"; median ratio of two seeds {_show(ratio, len(x))}"
    if ends:
        excess = estimate(pairwise_median(np.subtract), [x, y], params)
        evidence += f"; median difference of two seeds {_show(excess, len(x))}"
    return Finding(
        f"{evidence}{_left_out(first, second)}",
        f"probability that a seed of {first.label} exceeds {times}one of {second.label}",
        effect,
        NO_PREFERENCE,
        "rank test",
        rank_test(x, y, params.seed),
        min(len(x), len(y)),
        plot,
        _within(ends, lambda bound, side: rank_test(x, y + bound, params.seed, side)),
    )


def paired(
    quantity: str,
    first: Sample,
    second: Sample,
    params: CompareParams,
    ends: Range | None = None,
    not_less_by: float = 0.0,
) -> Finding:
    """Compare two versions of the same seeds: is the first one larger on average over seeds?

    With `not_less_by` the claim is only that the first one is not smaller by so much.
    """
    differences = Sample("", first.values - second.values).known
    plot = {**_plot(quantity, first, second), "paired": True}
    if not len(differences):
        return _nothing(quantity, plot, ends)
    effect = estimate_mean(differences, params.confidence)
    bound = f", tested against {number(-not_less_by)}" if not_less_by else ""
    return Finding(
        f"{quantity}: {_iqm(first, params)}, {_iqm(second, params)}; mean difference of the same "
        f"seeds {_show(effect, len(differences))}{bound}{_left_out(first, second)}",
        f"mean of {first.label} less {second.label}, seed by seed",
        effect,
        -not_less_by,
        "sign-flip test",
        sign_test(differences + not_less_by, params.seed),
        len(differences),
        plot,
        _within(ends, lambda bound, side: sign_test(differences - bound, params.seed, side)),
    )


def less_spread(
    quantity: str, first: Sample, second: Sample, params: CompareParams, ends: Range
) -> Finding:
    """Compare the spread over seeds, relative to the median: does the first one have less?"""
    x, y = first.values, second.values
    plot = _plot(quantity, first, second)
    if 0 in (np.median(x), np.median(y)):
        return _nothing(quantity, plot, ends)
    effect = estimate(lambda x, y: relative_spread(y) - relative_spread(x), [x, y], params)
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
        "permutation test of the relative spread",
        spread_test(x, y, params.seed),
        min(len(x), len(y)),
        plot,
        _within(ends, lambda bound, side: excess_spread_test(y, x, bound, side)),
    )


def more_effort(
    quantity: str, first: Efforts, second: Efforts, params: CompareParams, ends: Range | None
) -> Finding:
    """Compare efforts of which bounds are known: does a seed of the first need more?

    The ends of a margin are ratios.
    """
    x, y = first.bounds, second.bounds
    effect = probability_of_improvement(x, y, params)
    efforts = ", ".join(
        f"{own.label} {number(np.median(own.spent))} "
        f"({own.reached.sum()} of {len(own.reached)} seeds got there)"
        for own in (first, second)
    )
    samples = [Sample(own.label, own.spent) for own in (first, second)]
    return Finding(
        f"median {quantity.lower()}, a seed that never got there counting with its whole "
        f"budget: {efforts}; a seed of {first.label} needs more than one of {second.label} with "
        f"probability {_show(effect, len(x))}",
        f"probability that a seed of {first.label} needs more than one of {second.label}",
        effect,
        NO_PREFERENCE,
        "rank test with bounds",
        rank_test(x, y, params.seed),
        min(len(x), len(y)),
        _plot(quantity, *samples)
        | {"reached": {own.label: own.reached.tolist() for own in (first, second)}},
        _within(ends, lambda bound, side: rank_test(x, bound * y, params.seed, side)),
    )


def both(findings: Sequence[Finding]) -> Finding:
    """Return the finding on a claim that holds only if all of several findings do.

    It is the one with the largest p value (Berger, "Multiparameter hypothesis testing and
    acceptance sampling", Technometrics 24, 1982). Effects on different sides decide nothing.
    """
    decisive = max(findings, key=lambda finding: finding.p)
    if len({np.sign(finding.side) for finding in findings}) > 1:
        decisive = replace(min(findings, key=lambda finding: finding.side), p=1.0)
    return replace(decisive, evidence="; and ".join(finding.evidence for finding in findings))


def _within(ends: Range | None, test: Callable[[float, OneSide], float]) -> Margin | None:
    """Return the test of whether an effect lies within a margin, if there is one."""
    return None if ends is None else Margin(ends, equivalence(test, *ends))


def _nothing(quantity: str, plot: Mapping[str, Any], ends: Range | None) -> Finding:
    evidence = f"{quantity}: no seed has a value that can be compared"
    margin = _within(ends, lambda bound, side: 1.0)
    return Finding(evidence, quantity, None, 0.0, "none", 1.0, 0, plot, margin)


def _plot(axis: str, *samples: Sample) -> dict[str, Any]:
    """Return the plot data, None for a seed without a value."""
    values = {
        sample.label: [None if np.isnan(value) else float(value) for value in sample.values]
        for sample in samples
    }
    return {"axis": axis, "values": values}


def _left_out(*samples: Sample) -> str:
    counts = [(len(sample.values) - len(sample.known), sample.label) for sample in samples]
    missing = ", ".join(f"{count} of {label}" for count, label in counts if count)
    return f"; seeds without a value are left out: {missing}" if missing else ""


def _iqm(sample: Sample, params: CompareParams) -> str:
    known = sample.known
    return f"{sample.label} {_show(estimate_iqm(known, params.confidence), len(known))}"


def _show(effect: Estimate, num_seeds: int) -> str:
    return style.estimate(effect.value, effect.low, effect.high, num_seeds)
