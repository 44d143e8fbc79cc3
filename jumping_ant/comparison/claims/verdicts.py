"""Verdicts on the source article's claims about its agents.

One rule gives every verdict. A claim is an effect and an exact two-sided test of no effect. All p
values of a family are corrected together (Holm 1979). A claim is *supported* where the corrected p
value is at most 1 - confidence and the effect lies on the claimed side, *refuted* where it lies on
the other side, and *inconclusive* otherwise. docs/claims.md has the claims.
"""

from collections.abc import Mapping
from typing import Any

from jumping_ant.comparison.claims.field import Field
from jumping_ant.comparison.claims.findings import Finding
from jumping_ant.comparison.claims.statements import CLAIMS, Claim, Table, claims
from jumping_ant.comparison.hypothesis_tests import holm
from jumping_ant.comparison.results import AgentResults
from jumping_ant.comparison.sample_sizes import MOST_SEEDS
from jumping_ant.looks.wording import p_value
from jumping_ant.params.blocks import CompareParams

ROUNDING = 1e-12  # 1 - 0.95 is a little more than 0.05


def check(
    results: Mapping[str, AgentResults],
    params: CompareParams,
    evaluation_episodes: int,
    table: Table = CLAIMS,
) -> list[dict[str, Any]]:
    """Return a verdict on each claim and the numbers behind it (docs/metrics.md has the keys).

    `evaluation_episodes` are those per evaluation during training, `table` the family of claims.
    """
    field = Field(list(results.values()), evaluation_episodes)
    judged = list(claims(table, field, params))
    corrected = holm([claim.finding.tested.p for claim in judged])
    verdicts = [
        verdict(claim.finding.side, p_holm, params.confidence)
        for claim, p_holm in zip(judged, corrected, strict=True)
    ]
    num_open = verdicts.count("inconclusive")
    return [
        _entry(*parts, len(judged), num_open, params)
        for parts in zip(judged, corrected, verdicts, strict=True)
    ]


def verdict(side: float, p_holm: float, confidence: float) -> str:
    """Return the verdict on an effect above 0 (as claimed) or below, from its corrected p value."""
    if p_holm > 1 - confidence + ROUNDING or side == 0:
        return "inconclusive"
    return "supported" if side > 0 else "refuted"


def _entry(
    claim: Claim,
    p_holm: float,
    outcome: str,
    num_claims: int,
    num_open: int,
    params: CompareParams,
) -> dict[str, Any]:
    finding, tested = claim.finding, claim.finding.tested
    seeds = "1 seed" if finding.num_seeds == 1 else f"{finding.num_seeds} seeds"
    p_values = f"p = {p_value(tested.p)}, {p_value(p_holm)} among {num_claims} claims"
    basis = f"{tested.test}, {seeds}: {p_values}"
    needed = {}
    if outcome == "inconclusive":
        level = (1 - params.confidence) / num_open
        number = finding.seeds_needed(level, params.power)
        # The formulas are for large samples: an undecided claim needs at least one seed more.
        number = None if number is None else max(number, finding.num_seeds + 1)
        needed = {"seeds_needed": number if number and number <= MOST_SEEDS else None}
        basis += f"; {_advice(finding, needed['seeds_needed'], params)}"
    return {
        "text": claim.text,
        "statement": claim.statement,
        "verdict": outcome,
        "evidence": f"{finding.evidence[:1].upper()}{finding.evidence[1:]} ({basis}).",
        "effect": _effect(finding),
        "test": tested.test,
        "p": tested.p,
        "p_holm": p_holm,
        **needed,
        "plot": dict(finding.plot),
    }


def _advice(finding: Finding, needed: int | None, params: CompareParams) -> str:
    few = finding.tested.smallest_p > 1 - params.confidence + ROUNDING
    start = "too few seeds for a verdict; " if few else ""
    number = f"about {needed}" if needed else f"more than {MOST_SEEDS:,}"
    return f"{start}if the effect is as found, {number} seeds decide it with power {params.power:g}"


def _effect(finding: Finding) -> dict[str, Any]:
    if finding.effect is None:
        return {"name": finding.name, "value": None, "low": None, "high": None}
    return {"name": finding.name, **finding.effect.as_dict("value")}
