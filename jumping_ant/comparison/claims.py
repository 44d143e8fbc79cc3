"""Verdicts on claims (`jumping_ant.params.claims`) about agents of which several seeds are known.

One rule gives every verdict. A claim is an effect, a two-sided test of no effect and, where it has
a margin, a test of an effect outside of it. The p values of a family are adjusted together
(`jumping_ant.comparison.step_down`). A claim is *equivalent* where "outside of the margin" is
rejected, else *supported* or *refuted* where "no effect" is, by the side on which the effect lies,
and *inconclusive* otherwise.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.comparison.estimates import (
    Estimate,
    difference_of_shares,
    estimate,
    estimate_iqm,
    estimate_mean,
    pairwise_median,
    relative_spread,
)
from jumping_ant.comparison.hypothesis_tests import (
    equivalence,
    excess_spread_test,
    rank_test,
    sign_test,
    spread_test,
)
from jumping_ant.comparison.results import AgentResults
from jumping_ant.comparison.step_down import Adjusted, adjust
from jumping_ant.media import style
from jumping_ant.media.style import number, p_value
from jumping_ant.params.blocks import CompareParams
from jumping_ant.params.claims import Claim, Measure
from jumping_ant.training import curves
from jumping_ant.training.curves import Unit, evaluations

Array = NDArray[np.float64]

LEVEL = 0.04  # [-] of any false verdict in a family of claims
ROUNDING = 1e-12  # of products of p values
RANDOM = "random"  # the algorithm
LUCK = 5.0  # [standard errors] above the mean of random episodes, which luck does not reach
AXES: dict[Measure, str] = {
    "return": "Return",
    "return_at_equal_steps": "Return in validation, after equal control steps",
    "return_at_equal_seconds": "Return in validation, after equal seconds",
    "return_of_learned": "Return of seeds that learned",
    "learned": "Share of seeds that learned",
    "steps_to_learn": "Control steps to learn anything",
    "seconds_to_learn": "Training seconds to learn anything",
    "spread": "Spread of the return over seeds, relative to its median",
    "flight": "Share of time in flight",
    "apex": "Apex of a jump [m]",
    "fluidity": "Fluidity (closer to 0 is more fluid)",
    "retention_world": "Share of the return kept in another world",
    "retention_senses": "Share of the return kept with broken senses and delays",
    "seconds_per_step": "Training seconds per control step",
    "speed_up": "Speed-up from one thread to all cores",
}
SECONDS: set[Measure] = {
    *("return_at_equal_seconds", "seconds_to_learn", "seconds_per_step", "speed_up"),
}
EFFORTS: dict[Measure, Unit] = {"steps_to_learn": "env_steps", "seconds_to_learn": "seconds"}
EQUAL: dict[Measure, Unit] = {
    "return_at_equal_steps": "env_steps",
    "return_at_equal_seconds": "seconds",
}
RATIOS: set[Measure] = {"return", "return_of_learned", "seconds_per_step"}  # say something, too


@dataclass(frozen=True)
class Sample:
    """One number per seed, and the label of the agent, or of the version of its policy."""

    label: str
    values: Array  # (num_seeds,); NaN where a seed has none
    bounds: Array | None = None  # of efforts, (num_seeds, 2): low < effort <= high, inf for never

    @property
    def known(self) -> Array:
        """Return the values of the seeds that have one."""
        return self.values[~np.isnan(self.values)]


@dataclass(frozen=True)
class Finding:
    """An effect, its significance before the correction for other claims, and the data to plot."""

    evidence: str  # the numbers, as text
    effect: Estimate | None  # of the first, less or over the second; None if nothing is compared
    none: float  # the effect where neither has more
    test: str  # its name
    p: float  # two-sided, of no effect
    p_outside: float | None  # of an effect outside of the margin, if there is one
    plot: dict[str, Any] = field(default_factory=dict)  # `axis`, `values` by label, ...

    @property
    def side(self) -> float:
        """Return a number above 0 where the first has more, below 0 where it has less."""
        return float(self.effect.value - self.none) if self.effect else 0.0


def on_seconds(claims: Iterable[Claim], is_so: bool = True) -> list[Claim]:
    """Return the claims that rest on a clock, or the others."""
    return [claim for claim in claims if (not SECONDS.isdisjoint(claim.measures)) == is_so]


def out_of_luck(agents: Iterable[AgentResults], num_episodes: int) -> float | None:
    """Return the mean return over episodes that no random agent reaches by luck, if there is one.

    It is the mean of an agent's episodes plus five standard errors of a mean of so many.
    """
    returns = [agent.episodes["return"] for agent in agents if agent.algorithm == RANDOM]
    limits = [float(own.mean() + LUCK * own.std() / np.sqrt(num_episodes)) for own in returns]
    return max(limits, default=None)


def judge(
    claims: Iterable[Claim],
    agents: Mapping[str, AgentResults],
    params: CompareParams,
    learned: float | None = None,
) -> dict[str, list[dict[str, Any]]]:
    """Return the verdicts on a family of claims, and which claims could not be asked.

    Args:
        claims: The family.
        agents: The measurements of all agents, by name.
        params: Of intervals and resamples.
        learned: The return above which an agent has learned something.

    Returns:
        `claims` and `not_asked`, with the keys of docs/measures-and-claims.md.
    """
    asked, not_asked = [], []
    for claim in claims:
        try:
            pairs = [samples(claim, measure, agents, learned) for measure in claim.measures]
        except LookupError as error:
            not_asked.append({"text": claim.text, "reason": error.args[0]})
        else:
            asked.append((claim, _both([_compare(claim, *pair, params) for pair in pairs])))
    adjusted = adjust([(finding.p, finding.p_outside) for _, finding in asked])
    judged = [_entry(*pair, own) for pair, own in zip(asked, adjusted, strict=True)]
    return {"claims": judged, "not_asked": not_asked}


def verdict(side: float, adjusted: Adjusted) -> str:
    """Return the verdict on an effect above 0 (as claimed) or below, from its adjusted p values."""
    if _is_rejected(adjusted.equivalence):
        return "equivalent"
    if _is_rejected(adjusted.difference) and side != 0:
        return "supported" if side > 0 else "refuted"
    return "inconclusive"


def _is_rejected(p: float | None) -> bool:
    return p is not None and p <= LEVEL + ROUNDING


# What is compared.


def samples(
    claim: Claim, measure: Measure, agents: Mapping[str, AgentResults], learned: float | None
) -> tuple[Measure, Sample, Sample]:
    """Return the measurements that a claim compares; a LookupError says which are lacking."""
    if learned is None:
        if measure in (*EFFORTS, "learned", "return_of_learned"):
            raise LookupError("no random agent, whose luck tells what has learned nothing")
        learned = np.nan
    both = [_version(agents, whom) for whom in (claim.agent, claim.against)]
    unit = (EFFORTS | EQUAL).get(measure, "env_steps")
    for agent, _ in both:
        if agent.curves and unit not in next(iter(agent.curves.values())):
            raise LookupError(f"no {unit} of {agent.label}")
    if measure in EQUAL:
        budget = min(float(agent.budgets(unit).min()) for agent, _ in both)
    measured = []
    for agent, version in both:
        quantities = agent.variants[version] if version else agent.quantities
        label = f"{agent.label}, {version.replace('_', ' ')}" if version else agent.label
        bounds = None
        if measure in EFFORTS:
            bounds = np.array([curves.onset(it, learned, unit) for it in agent.curves.values()])
            values = np.minimum(bounds[:, 1], agent.budgets(unit))
        elif measure in EQUAL:
            drawn = (evaluations(it, unit) for it in agent.curves.values())
            values = np.array([np.interp(budget, *curve, left=np.nan) for curve in drawn])
        elif measure in ("learned", "return_of_learned"):
            onsets = [curves.onset(it, learned, "env_steps")[1] for it in agent.curves.values()]
            has_learned = np.isfinite(onsets)
            values = has_learned * 1.0
            if measure == "return_of_learned":
                values = np.where(has_learned, quantities["return"], np.nan)
        else:
            name = "return" if measure == "spread" else measure
            if name not in quantities:
                raise LookupError(f"no {measure} of {agent.label}")
            values = quantities[name]
        measured.append(Sample(label, values, bounds))
    return measure, measured[0], measured[1]


def _version(agents: Mapping[str, AgentResults], whom: str) -> tuple[AgentResults, str]:
    name, _, version = whom.partition("/")
    if name not in agents:
        raise LookupError(f"no agent {name} in this run")
    if version and version not in agents[name].variants:
        raise LookupError(f"no version {version} of {name} in this run")
    return agents[name], version


# How it is compared.


def _compare(
    claim: Claim, measure: Measure, one: Sample, other: Sample, params: CompareParams
) -> Finding:
    axis, margin = AXES[measure], claim.margin
    if measure in EFFORTS:
        return efforts(axis, one, other, params, margin)
    if measure == "learned":
        return shares(axis, one, other, params)
    if measure == "spread":
        return spreads(axis, one, other, params, margin)
    if claim.agent.partition("/")[0] == claim.against.partition("/")[0]:
        return paired(axis, one, other, params, margin)
    return independent(axis, one, other, params, margin, with_ratio=measure in RATIOS)


def independent(
    axis: str,
    one: Sample,
    other: Sample,
    params: CompareParams,
    margin: float | None = None,
    with_ratio: bool = False,
) -> Finding:
    """Compare two agents: by how much do the seeds of one exceed those of the other?

    The effect is the median difference of two seeds (Hodges and Lehmann 1963).
    """
    x, y = one.known, other.known
    if not (len(x) and len(y)):
        return _nothing(axis, one, other, margin)
    effect = pairwise_median(np.subtract, x, y, params.confidence)
    text = f"{_middles(axis, one, other, params)}; median difference of two seeds {_show(effect)}"
    if with_ratio and min(x.min(), y.min()) > 0:
        text += f", ratio {_show(pairwise_median(np.divide, x, y, params.confidence))}"
    return Finding(
        text,
        effect,
        0.0,
        "rank test",
        rank_test(x, y),
        _outside(margin, lambda bound, side: rank_test(x, y + bound, side)),
        _plot(axis, one, other),
    )


def paired(
    axis: str, one: Sample, other: Sample, params: CompareParams, margin: float | None = None
) -> Finding:
    """Compare the same seeds twice: by how much does one exceed the other on average?"""
    differences = Sample("", one.values - other.values).known
    if not len(differences):
        return _nothing(axis, one, other, margin)
    effect = estimate_mean(differences, params.confidence)
    middles = _middles(axis, one, other, params)
    return Finding(
        f"{middles}; mean difference of the same seeds {_show(effect)}",
        effect,
        0.0,
        "sign-flip test",
        sign_test(differences, params.seed),
        _outside(margin, lambda bound, side: sign_test(differences - bound, params.seed, side)),
        _plot(axis, one, other) | {"paired": True},
    )


def spreads(
    axis: str, one: Sample, other: Sample, params: CompareParams, margin: float | None = None
) -> Finding:
    """Compare the spread over seeds, relative to the median."""
    x, y = one.known, other.known
    if not (len(x) and len(y)) or 0 in (np.median(x), np.median(y)):
        return _nothing(axis, one, other, margin)
    effect = estimate(lambda x, y: relative_spread(x) - relative_spread(y), [x, y], params)
    shown = ", ".join(
        f"{own.label} {number(relative_spread(own.known))} (worst seed {number(own.known.min())}, "
        f"median {number(np.median(own.known))})"
        for own in (one, other)
    )
    return Finding(
        f"{axis}: {shown}; difference {_show(effect)}",
        effect,
        0.0,
        "permutation test of the spread",
        spread_test(x, y, params.seed),
        _outside(margin, lambda bound, side: excess_spread_test(x, y, bound, side)),
        _plot("Return", one, other),
    )


def shares(axis: str, one: Sample, other: Sample, params: CompareParams) -> Finding:
    """Compare the shares of seeds that did something, 1 for each, or did not, 0."""
    x, y = one.values, other.values
    shown = ", ".join(
        f"{own.label} {own.values.sum():.0f} of {len(own.values)}" for own in (one, other)
    )
    effect = difference_of_shares(x, y, params.confidence)
    return Finding(
        f"{axis}: {shown}; difference {_show(effect)}",
        effect,
        0.0,
        "rank test",
        rank_test(x, y),
        None,
        _plot(axis, one, other),
    )


def efforts(
    axis: str, one: Sample, other: Sample, params: CompareParams, margin: float | None = None
) -> Finding:
    """Compare efforts of which bounds are known; the effect and the margin are ratios."""
    x, y = one.bounds, other.bounds
    assert x is not None and y is not None
    effect = pairwise_median(np.divide, one.values, other.values, params.confidence)
    shown = ", ".join(
        f"{own.label} {number(np.median(own.values))} ({_reached(own).sum()} of {len(own.values)} "
        "seeds got there)"
        for own in (one, other)
    )
    return Finding(
        f"{axis}, in the median, whole budgets for seeds that never got there: {shown}; median "
        f"ratio of two seeds {_show(effect)}",
        effect,
        1.0,
        "rank test with bounds",
        rank_test(x, y),
        None
        if margin is None
        else equivalence(lambda bound, side: rank_test(x, bound * y, side), 1 / margin, margin),
        _plot(axis, one, other)
        | {"reached": {own.label: _reached(own).tolist() for own in (one, other)}},
    )


def _reached(sample: Sample) -> NDArray[np.bool_]:
    assert sample.bounds is not None
    return np.isfinite(sample.bounds[:, 1])


def _both(findings: Sequence[Finding]) -> Finding:
    """Return the finding on a claim that holds only if all of several findings do.

    It is the one with the largest p value (Berger, "Multiparameter hypothesis testing and
    acceptance sampling", Technometrics 24, 1982). Effects on different sides decide nothing.
    """
    decisive = max(findings, key=lambda finding: finding.p)
    if len({np.sign(finding.side) for finding in findings}) > 1:
        decisive = replace(min(findings, key=lambda finding: finding.side), p=1.0)
    return replace(decisive, evidence="; and ".join(finding.evidence for finding in findings))


def _outside(margin: float | None, test: Callable[..., float]) -> float | None:
    return None if margin is None else equivalence(test, -margin, margin)


def _nothing(axis: str, one: Sample, other: Sample, margin: float | None) -> Finding:
    text = f"{axis}: no seed has a value that can be compared"
    p_outside = None if margin is None else 1.0
    return Finding(text, None, 0.0, "none", 1.0, p_outside, _plot(axis, one, other))


# How it is told.


def _plot(axis: str, *shown: Sample) -> dict[str, Any]:
    """Return the plot data, None for a seed without a value."""
    values = {
        sample.label: [None if np.isnan(value) else float(value) for value in sample.values]
        for sample in shown
    }
    return {"axis": axis, "values": values}


def _middles(axis: str, one: Sample, other: Sample, params: CompareParams) -> str:
    shown = []
    for sample in (one, other):
        num, left_out = len(sample.known), len(sample.values) - len(sample.known)
        middle = estimate_iqm(sample.known, params.confidence)
        interval = style.estimate(middle.value, middle.low, middle.high, num)
        aside = f" ({left_out} of {len(sample.values)} seeds without a value)" if left_out else ""
        shown.append(f"{sample.label} {interval}{aside}")
    return f"{axis}: {', '.join(shown)}"


def _show(effect: Estimate) -> str:
    if np.isnan(effect.low):
        return f"{number(effect.value)} (too few seeds for an interval)"
    return style.estimate(effect.value, effect.low, effect.high, num_seeds=2)


def _entry(claim: Claim, finding: Finding, adjusted: Adjusted) -> dict[str, Any]:
    outcome = verdict(finding.side if claim.side == "more" else -finding.side, adjusted)
    basis = f"{finding.test}: p = {p_value(finding.p)}, {p_value(adjusted.difference)} adjusted"
    if finding.p_outside is not None and adjusted.equivalence is not None:
        p_values = f"p = {p_value(finding.p_outside)}, {p_value(adjusted.equivalence)} adjusted"
        basis += f"; margin {number(claim.margin or 0)}: {p_values}"
    effect = finding.effect
    known = effect is not None and np.isfinite(effect.low)
    return {
        "text": claim.text,
        "statement": claim.statement,
        "verdict": outcome,
        "evidence": f"{finding.evidence} ({basis}).",
        "measure": claim.measure,
        "agents": [claim.agent, claim.against],
        "side": claim.side,
        "value": float(effect.value) if effect else None,
        "low": float(effect.low) if effect and known else None,
        "high": float(effect.high) if effect and known else None,
        "no_effect": finding.none,
        "margin": claim.margin,
        "test": finding.test,
        "p": finding.p,
        "p_adjusted": adjusted.difference,
        "p_equivalence": finding.p_outside,
        "p_equivalence_adjusted": adjusted.equivalence,
        "plot": finding.plot,
    }
