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

from jumping_ant.comparison.claims.field import Field
from jumping_ant.comparison.claims.findings import Finding
from jumping_ant.comparison.claims.statements import CLAIMS, Claim, Table, claims
from jumping_ant.comparison.results import AgentResults
from jumping_ant.comparison.step_down import Adjusted, adjust
from jumping_ant.looks.wording import capitalized, number, p_value
from jumping_ant.params.blocks import CompareParams

ROUNDING = 1e-12  # of products of p values


def check(
    results: Mapping[str, AgentResults],
    params: CompareParams,
    evaluation_episodes: int,
    table: Table = CLAIMS,
) -> list[dict[str, Any]]:
    """Return a verdict on each claim and the numbers behind it.

    docs/measures-and-claims.md has the keys.
    `evaluation_episodes` are those per evaluation during training, `table` the family of claims.
    """
    field = Field(list(results.values()), evaluation_episodes)
    judged = list(claims(table, field, params))
    adjusted = adjust([(claim.finding.p, _p_outside(claim.finding)) for claim in judged])
    level = params.levels[0] + ROUNDING
    return [
        _entry(claim, own, level, len(judged)) for claim, own in zip(judged, adjusted, strict=True)
    ]


def check_again(
    earlier: Sequence[Mapping[str, Any]],
    results: Mapping[str, AgentResults],
    params: CompareParams,
    evaluation_episodes: int,
    look: int,
) -> list[dict[str, Any]]:
    """Return the claims after a later look at more seeds (docs/measures-and-claims.md).

    Claims that get later looks are tested again, on all seeds of their agents, with the level of
    this look; the others keep their verdicts.

    Args:
        earlier: What `check` returned, or this function at the look before.
        results: Of all agents, those of claims that are tested again with their added seeds.
        params: With the levels of all looks.
        evaluation_episodes: Those per evaluation during training.
        look: 1 for the first one after the run itself.
    """
    field = Field(list(results.values()), evaluation_episodes)
    found = {claim.text: claim for claim in claims(CLAIMS, field, params)}
    tested = [
        found.get(entry["text"]) if gets_later_looks(entry, results) else None for entry in earlier
    ]
    adjusted = adjust(
        [
            (claim.finding.p, _p_outside(claim.finding)) if claim else _settled(entry, params)
            for claim, entry in zip(tested, earlier, strict=True)
        ]
    )
    level = params.levels[look] + ROUNDING
    return [
        _entry(claim, own, level, len(earlier)) | {"look": look} if claim else dict(entry)
        for claim, own, entry in zip(tested, adjusted, earlier, strict=True)
    ]


def is_open(entry: Mapping[str, Any]) -> bool:
    """Return whether a claim has no verdict yet."""
    return bool(entry["verdict"] == "inconclusive")


def gets_later_looks(entry: Mapping[str, Any], results: Mapping[str, AgentResults]) -> bool:
    """Return whether more seeds could decide a claim.

    It is open, and none of its agents imitates another: added seeds would imitate the best of the
    seeds that were added, and not the policy that was demonstrated in the run.
    """
    compared = [agent for name, agent in results.items() if name in entry["agents"]]
    return is_open(entry) and not any(agent.demonstrator for agent in compared)


def _settled(entry: Mapping[str, Any], params: CompareParams) -> tuple[float, float | None]:
    """Return p values of 0 for hypotheses that were rejected before, of 1 for those that are left.

    Both of a claim may be rejected: a difference that is sure and below the margin.
    """
    level = params.levels[entry.get("look", 0)] + ROUNDING
    equivalence = entry["p_equivalence_adjusted"]
    return (
        float(entry["p_adjusted"] > level),
        None if equivalence is None else float(equivalence > level),
    )


def verdict(side: float, adjusted: Adjusted, level: float) -> str:
    """Return the verdict on an effect above 0 (as claimed) or below, from its adjusted p values."""
    if adjusted.difference <= level and side != 0:
        return "supported" if side > 0 else "refuted"
    return "equivalent" if _is_small(adjusted, level) else "inconclusive"


def _is_small(adjusted: Adjusted, level: float) -> bool:
    """Return whether the effect lies within the margin."""
    return adjusted.equivalence is not None and adjusted.equivalence <= level


def _p_outside(finding: Finding) -> float | None:
    return finding.margin.p if finding.margin else None


def _entry(claim: Claim, adjusted: Adjusted, level: float, num_claims: int) -> dict[str, Any]:
    finding = claim.finding
    outcome = verdict(finding.side, adjusted, level)
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
        if outcome in ("supported", "refuted") and _is_small(adjusted, level):
            basis += "; the difference is below practical size"
    return {
        "text": claim.text,
        "statement": claim.statement,
        "agents": list(claim.agents),
        "verdict": outcome,
        "evidence": f"{capitalized(finding.evidence)} ({basis}).",
        "effect": _effect(finding),
        "no_effect": finding.no_effect,
        "test": finding.test,
        "p": finding.p,
        "p_adjusted": adjusted.difference,
        "margin": ends,
        "p_equivalence": _p_outside(finding),
        "p_equivalence_adjusted": adjusted.equivalence,
        "plot": dict(finding.plot),
    }


def _effect(finding: Finding) -> dict[str, Any]:
    if finding.effect is None:
        return {"name": finding.name, "value": None, "low": None, "high": None}
    return {"name": finding.name, **finding.effect.as_dict("value")}
