"""The number of seeds a comparison needs to be decided if the observed effect is the true one.

Sources: Noether, "Sample size determination for some common nonparametric tests", Journal of the
American Statistical Association 82, 1987; Guenther, "Sample size formulas for normal theory t
tests", The American Statistician 35, 1981. A permutation test of means has the power of Student's
test in large samples (Hoeffding, Annals of Mathematical Statistics 23, 1952), so Guenther's
formulas are used for the sign-flip test and for the test of spreads.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from jumping_ant.comparison.estimates import relative_deviations
from jumping_ant.comparison.hypothesis_tests import smallest_p

Array = NDArray[np.float64]

MOST_SEEDS = 1000  # above which no number is given


def for_rank_test(probability: float, level: float, power: float) -> int | None:
    """Return how many seeds each agent needs for a rank test (Noether 1987).

    Args:
        probability: Probability that a seed of the first agent beats one of the second.
        level: Two-sided level of the test.
        power: Required probability of finding the difference.

    Returns:
        The number, at least what the exact test needs to reach the level at all; None above
        `MOST_SEEDS`.
    """
    distance = abs(probability - 0.5)
    needed = _quantiles(level, power) ** 2 / (6 * distance**2) if distance > 0 else math.inf
    return _whole(needed, lambda num: smallest_p(num, num), level)


def for_sign_test(differences: Array, level: float, power: float) -> int | None:
    """Return how many seeds a sign-flip test needs to find the observed mean difference.

    The test needs as many as Student's (Guenther 1981): the two agree for large samples.

    Args:
        differences: Shape (num,).
        level: Two-sided level of the test.
        power: Required probability of finding the difference.

    Returns:
        The number, at least what the exact test needs to reach the level at all; None above
        `MOST_SEEDS`.
    """
    mean, deviation = abs(differences.mean()), _deviation(differences)
    needed = _student_seeds(mean, deviation, 1, level, power)
    return _whole(needed, lambda num: 2.0 ** (1 - num), level)


def for_spread_test(x: Array, y: Array, level: float, power: float) -> int | None:
    """Return how many seeds each agent needs to find the observed difference in relative spread.

    Args:
        x: First sample, shape (num_x,).
        y: Second sample, shape (num_y,).
        level: Two-sided level of the test.
        power: Required probability of finding the difference.

    Returns:
        The number for Student's test of the deviations (Guenther 1981), at least what the exact
        test needs to reach the level at all; None above `MOST_SEEDS`.
    """
    own, other = relative_deviations(x), relative_deviations(y)
    pooled = math.hypot(_deviation(own), _deviation(other)) / math.sqrt(2)
    needed = _student_seeds(abs(own.mean() - other.mean()), pooled, 2, level, power)
    return _whole(needed, lambda num: smallest_p(num, num), level)


def _student_seeds(
    effect: float, deviation: float, num_samples: int, level: float, power: float
) -> float:
    """Return how many observations of each sample Student's test needs (Guenther 1981)."""
    if not effect > 0:
        return math.inf
    correction = stats.norm.isf(level / 2) ** 2 / (2 * num_samples)
    needed = num_samples * (_quantiles(level, power) * deviation / effect) ** 2
    return float(needed + correction)


def _quantiles(level: float, power: float) -> float:
    """Return the sum of the normal quantiles of a two-sided level and of a power."""
    return float(stats.norm.isf(level / 2) + stats.norm.ppf(power))


def _deviation(sample: Array) -> float:
    """Return the estimated standard deviation of a sample's population; 0 for one observation."""
    return float(sample.std(ddof=1)) if len(sample) > 1 else 0.0


def _whole(needed: float, smallest: Callable[[int], float], level: float) -> int | None:
    """Round up, at least to the number where the smallest p value reaches the level."""
    if not needed <= MOST_SEEDS:
        return None
    num = max(1, math.ceil(needed))
    while smallest(num) > level:
        num += 1
    return num
