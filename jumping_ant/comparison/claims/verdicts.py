"""Verdicts on the source article's claims about its agents.

One rule gives every verdict. A claim is an effect, a two-sided test of no effect and, where it has
a margin, a test of an effect outside of it. The p values of a family are adjusted together
(`jumping_ant.comparison.step_down`). A claim is *supported* where "no effect" is rejected and the
effect lies on the claimed side, *refuted* where it lies on the other side, *equivalent* where only
"outside of the margin" is rejected, and *inconclusive* otherwise. docs/measures-and-claims.md has
the claims.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from jumping_ant.comparison.claims.evidence import Case
from jumping_ant.comparison.claims.field import Field
from jumping_ant.comparison.claims.findings import Finding
from jumping_ant.comparison.claims.statements import CLAIMS, Row, Table
from jumping_ant.comparison.results import AgentResults
from jumping_ant.comparison.step_down import Adjusted, adjust
from jumping_ant.media.style import capitalized, number, p_value
from jumping_ant.params.blocks import CompareParams

LEVEL = 0.04  # [-] of any false verdict in a family of claims
ROUNDING = 1e-12  # of products of p values


def check(
    results: Mapping[str, AgentResults],
    params: CompareParams,
    evaluation_episodes: int,
    table: Table = CLAIMS,
) -> list[dict[str, Any]]:
    """Return a verdict on each claim of a family, with the keys of docs/measures-and-claims.md.

    `evaluation_episodes` are those per evaluation during training.
    """
    field = Field(list(results.values()), evaluation_episodes)
    claims = [
        (row, agents, finding)
        for select, rows in table
        for agents in select(field)
        for row in rows
        if (finding := row.compare(Case(agents, field, params)))
    ]
    adjusted = adjust([(finding.p, _p_outside(finding)) for _, _, finding in claims])
    return [_entry(*claim, own, len(claims)) for claim, own in zip(claims, adjusted, strict=True)]


def verdict(side: float, adjusted: Adjusted) -> str:
    """Return the verdict on an effect above 0 (as claimed) or below, from its adjusted p values."""
    if _is_rejected(adjusted.difference) and side != 0:
        return "supported" if side > 0 else "refuted"
    return "equivalent" if _is_rejected(adjusted.equivalence) else "inconclusive"


def _is_rejected(p: float | None) -> bool:
    return p is not None and p <= LEVEL + ROUNDING


def _p_outside(finding: Finding) -> float | None:
    return finding.margin.p if finding.margin else None


def _entry(
    row: Row,
    agents: Sequence[AgentResults],
    finding: Finding,
    adjusted: Adjusted,
    num_claims: int,
) -> dict[str, Any]:
    unknown = dict.fromkeys(("value", "low", "high"))
    effect = finding.effect.as_dict("value") if finding.effect else unknown
    outcome = verdict(finding.side, adjusted)
    seeds = "1 seed" if finding.num_seeds == 1 else f"{finding.num_seeds} seeds"
    p_values = f"p = {p_value(finding.p)}, {p_value(adjusted.difference)} among {num_claims} claims"
    basis = f"{finding.test}, {seeds}: {p_values}"
    ends = None
    if (margin := finding.margin) and adjusted.equivalence is not None:
        ends = dict(zip(("low", "high"), margin.ends, strict=True))
        basis += (
            f"; margin {number(margin.ends[0])} to {number(margin.ends[1])}: "
            f"p = {p_value(margin.p)}, {p_value(adjusted.equivalence)}"
        )
        if outcome in ("supported", "refuted") and _is_rejected(adjusted.equivalence):
            basis += "; the difference is below practical size"
    return {
        "text": row.text.format(*(agent.label for agent in agents)),
        "statement": row.statement,
        "agents": [agent.name for agent in agents],
        "verdict": outcome,
        "evidence": f"{capitalized(finding.evidence)} ({basis}).",
        "effect": {"name": finding.name, **effect},
        "no_effect": finding.no_effect,
        "test": finding.test,
        "p": finding.p,
        "p_adjusted": adjusted.difference,
        "margin": ends,
        "p_equivalence": _p_outside(finding),
        "p_equivalence_adjusted": adjusted.equivalence,
        "plot": dict(finding.plot),
    }
