"""Permutation tests of two samples, or of one, for a difference and for the lack of one.

If nothing differs, every arrangement of the data (seeds assigned to the two agents, or signs of
paired differences) is equally likely. The p value is the share of arrangements whose statistic is
at least as extreme as that of the data: valid for any number of seeds and with ties. For ranks and
signs every arrangement counts; where that takes too long, `MOST` random ones, including the
observed data, stand for all (Phipson and Smyth 2010).

Sources: Fisher, "The Design of Experiments", 1935, section 21 (signs of paired differences); Mann
and Whitney, Annals of Mathematical Statistics 18, 1947 (pairs won); Mantel, Biometrics 23, 1967
(pairs won where samples hold bounds); Levene, in "Contributions to Probability and Statistics",
1960, and Brown and Forsythe, Journal of the American Statistical Association 69, 1974 (deviations
from the median); Welch, Biometrika 34, 1947; Phipson and Smyth, Statistical Applications in
Genetics and Molecular Biology 9, 2010; Schuirmann, Journal of Pharmacokinetics and Biopharmaceutics
15, 1987 (two one-sided tests).
"""

import math
from collections.abc import Callable
from functools import lru_cache
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from jumping_ant.comparison.estimates import (
    deals,
    pair_scores,
    relative_deviations,
    relative_spread,
)

Array = NDArray[np.float64]
OneSide = Literal["greater", "less"]
Side = Literal[OneSide, "two-sided"]  # what counts as extreme

MOST = 200_000  # arrangements that stand for all
MOST_SIGNS = 34  # differences of which all signs are tried
ROUNDING = 1e-9  # of the largest statistic: arrangements equal up to rounding count as ties


def rank_test(x: Array, y: Array, side: Side = "two-sided") -> float:
    """Return the p value of two independent samples that win half of the pairs each.

    Null: both come from one distribution. The statistic is proportional to Mann and Whitney's U
    less its mean.

    Args:
        x: First sample, shape (num_x,), or (num_x, 2) with bounds as in `pair_scores`.
        y: Second sample, shape (num_y,) or (num_y, 2).
        side: Whether x wins more (greater), fewer (less), or either.
    """
    pooled = np.concatenate([x, y])
    # Pairs within a sample cancel, so the sum over x equals that of its pairs with y.
    scores = np.rint((2 * pair_scores(pooled, pooled) - 1).sum(axis=1)).astype(np.int64)
    sums, chances = deals(scores, len(x))
    own = scores[: len(x)].sum()
    is_as_far = {"two-sided": abs(sums) >= abs(own), "greater": sums >= own, "less": sums <= own}
    return min(1.0, float(chances[is_as_far[side]].sum()))


def spread_test(x: Array, y: Array, seed: int) -> float:
    """Return the two-sided p value of two samples that spread equally, relative to their medians.

    Null: divided by their medians, both come from one distribution. The statistic is the difference
    in `relative_spread` (Levene 1960; Brown and Forsythe 1974). As medians are estimates, the test
    is not quite exact (docs/tables.md). Shapes are (num_x,) and (num_y,); `seed` is as in
    `rank_test`.
    """
    medians = np.median(x), np.median(y)
    if 0 in medians:
        return 1.0
    aligned = np.concatenate([x / medians[0], y / medians[1]])
    return _two_samples(aligned, len(x), relative_spread, seed, "two-sided")


def excess_spread_test(x: Array, y: Array, bound: float, side: OneSide) -> float:
    """Return the p value of a relative spread of x that exceeds that of y by a bound.

    Welch's test of the deviations from the medians (Welch 1947; Brown and Forsythe 1974). As they
    are neither normal nor independent, it rejects too often at small levels, so its p value is
    doubled (docs/tables.md). Samples without any spread prove nothing.

    Args:
        x: First sample, shape (num_x,).
        y: Second sample, shape (num_y,).
        bound: The excess under the null hypothesis [-].
        side: Whether the excess is greater or less than the bound.
    """
    if min(len(x), len(y)) < 2:
        return 1.0
    of_x, of_y = relative_deviations(x), relative_deviations(y)
    errors = np.array([sample.var(ddof=1) / len(sample) for sample in (of_x, of_y)])
    if not errors.sum() > 0:
        return 1.0
    freedom = errors.sum() ** 2 / (errors**2 / [len(x) - 1, len(y) - 1]).sum()
    t = (of_x.mean() - of_y.mean() - bound) / np.sqrt(errors.sum())
    return min(1.0, 2 * float(stats.t.sf(t if side == "greater" else -t, freedom)))


def sign_test(differences: Array, seed: int, side: Side = "two-sided") -> float:
    """Return the p value of paired differences with a mean of 0.

    Null: they are distributed symmetrically around 0, so every sign is equally likely (Fisher 1935,
    section 21). The statistic is their sum. Their shape is (num,); `seed` and `side` are as in
    `rank_test`.
    """
    num = len(differences)
    if num > MOST_SIGNS:
        signs = np.random.default_rng(seed).choice([-1, 1], (MOST, num))
        signs[0] = 1
        return _share_as_far(signs @ differences, side)
    # The sums of two halves, each under all signs: those of one for which both are as far.
    halves = [_signed_sums(half) for half in (differences[: num // 2], differences[num // 2 :])]
    own = differences.sum()
    far = abs(own) if side == "two-sided" else own if side == "greater" else -own
    far -= ROUNDING * np.abs(differences).sum()
    above = len(halves[1]) - np.searchsorted(np.sort(halves[1]), far - halves[0])
    share = float(above.sum() / 2**num)  # of sums of one side, as many as of the other
    return min(1.0, 2 * share) if side == "two-sided" else share


def _signed_sums(values: Array) -> Array:
    sums = np.zeros(1)
    for value in values:
        sums = np.concatenate([sums + value, sums - value])
    return sums


def equivalence(test: Callable[[float, OneSide], float], low: float, high: float) -> float:
    """Return the p value of an effect outside a margin from `low` to `high` (Schuirmann 1987).

    It is the larger one of two one-sided tests: `test` takes a bound and the side of it.
    """
    return max(test(low, "greater"), test(high, "less"))


def _two_samples(
    pooled: Array, num_x: int, statistic: Callable[[Array], Array], seed: int, side: Side
) -> float:
    """Test the difference in a statistic; `pooled` has both samples, x first."""
    dealt = pooled[_deals(len(pooled), num_x, seed, MOST)]
    return _share_as_far(statistic(dealt[:, :num_x]) - statistic(dealt[:, num_x:]), side)


@lru_cache(maxsize=2)
def _deals(num: int, num_x: int, seed: int, most: int) -> NDArray[np.uint16]:
    """Return ways to deal `num` indices to two samples, (num_deals, num), the first in order."""
    if math.comb(num, num_x) > most:
        deals = np.tile(np.arange(num, dtype=np.uint16), (most, 1))
        np.random.default_rng(seed).permuted(deals[1:], axis=1, out=deals[1:])
        return deals
    # The complements of combinations in lexicographic order are in the reverse order.
    left = reversed(list(combinations(range(num), num - num_x)))
    chosen = combinations(range(num), num_x)
    return np.array([x + y for x, y in zip(chosen, left, strict=True)], dtype=np.uint16)


def _share_as_far(values: Array, side: Side) -> float:
    """Return the share of arrangements that lie at least as far on a side as the first one."""
    distance = np.abs(values) if side == "two-sided" else values if side == "greater" else -values
    largest = np.max(np.abs(values), where=np.isfinite(values), initial=0.0)
    # An arrangement whose statistic is NaN counts as at least as far: it is no evidence.
    return float(np.mean(~(distance < distance[0] - ROUNDING * largest)))
