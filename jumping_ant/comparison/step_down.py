"""The correction of p values for the number of claims: differences and equivalences together.

Each claim has the hypothesis that nothing differs and, where it has a margin, a second one: that
the difference is at least the margin. Both of a claim are never true. So the sequentially rejective
procedure of Shaffer (1986) applies: at each step, every hypothesis is rejected whose p value is at
most level / k, where k counts the claims of which a hypothesis is left. When the first true one is
rejected, k still counts the claim of every true one, so the chance of any false rejection is at
most the level, whatever the dependence (Bonferroni). Without margins this is Holm's procedure.

Source: Shaffer, "Modified sequentially rejective multiple test procedures", Journal of the American
Statistical Association 81, 1986.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Adjusted:
    """A claim's p values, adjusted: the least level at which the procedure rejects each."""

    difference: float
    equivalence: float | None


def adjust(p_values: Sequence[tuple[float, float | None]]) -> list[Adjusted]:
    """Return the adjusted p values of claims, in the order given.

    Args:
        p_values: Of each claim, that of no difference, and that of a difference of at least the
            margin, None where it has no margin.
    """
    hypotheses = sorted(
        (p, claim, kind)
        for claim, pair in enumerate(p_values)
        for kind, p in enumerate(pair)
        if p is not None
    )
    left = Counter(claim for _, claim, _ in hypotheses)
    adjusted, level = {}, 0.0
    for p, claim, kind in hypotheses:
        level = adjusted[claim, kind] = max(level, min(1.0, len(left) * p))
        left[claim] -= 1
        left += Counter()  # drops claims of which nothing is left
    return [
        Adjusted(adjusted[claim, 0], adjusted.get((claim, 1))) for claim in range(len(p_values))
    ]
