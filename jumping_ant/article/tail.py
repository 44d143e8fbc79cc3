"""How likely one test of one new policy is to reach a printed value.

Several policies were trained, and each was tested several times; some of the tests reached the
value. Policies differ: of one all tests reach it, of another none. So the number of tests of a
policy that reach it is beta-binomial (Skellam, Journal of the Royal Statistical Society B 10,
1948): a policy's own chance is drawn from a beta distribution, whose mean is the probability
sought, and which spreads from all policies alike to some always and the others never.

The mean and the spread have a posterior distribution: Jeffreys' prior for the mean, which gives
intervals that cover well in small samples (Brown, Cai and DasGupta, Statistical Science 16, 2001),
and a uniform one for the correlation of two tests of one policy (Gelman et al., "Bayesian Data
Analysis", 3rd edition, section 5.3, has the model). It needs no large sample, and no policy that
reached the value: resampling eight policies gives an interval below the truth in a fifth of samples
or more, and [0, 0] if none reached it. A test simulates how often this one covers.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaln

CONFIDENCE = 0.95
# The grid that integrals are sums over: means of equal weight under Jeffreys' prior, and
# correlations of equal weight, shapes (num_means, 1) and (num_correlations,).
MEANS = np.sin(np.pi / 2 * (np.arange(500)[:, None] + 0.5) / 500) ** 2
CORRELATIONS = (np.arange(30) + 0.5) / 30


@dataclass(frozen=True)
class Probability:
    """A probability, the mean of its posterior distribution, with its central 95 % interval."""

    value: float
    low: float
    high: float


def probability(reached: Sequence[int], num_tests: int) -> Probability:
    """Return the probability that one test of a new policy reaches a value.

    Args:
        reached: How many tests of each policy reached it.
        num_tests: Number of tests of each policy.
    """
    log_likelihood = sum(
        times * _log_likelihood(count, num_tests) for count, times in Counter(reached).items()
    )
    weights = np.exp(log_likelihood - np.max(log_likelihood)).sum(axis=1)
    weights /= weights.sum()
    edges = (1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2
    low, high = MEANS[np.searchsorted(np.cumsum(weights), edges), 0]
    return Probability(float(weights @ MEANS[:, 0]), float(low), float(high))


@cache
def _log_likelihood(count: int, num_tests: int) -> NDArray[np.float64]:
    """Return that of a policy, up to a constant, shape (num_means, num_correlations)."""
    strength = 1 / CORRELATIONS - 1  # the sum of the beta distribution's two parameters
    first, second = MEANS * strength, (1 - MEANS) * strength
    reached = betaln(first + count, second + num_tests - count)
    return np.asarray(reached - betaln(first, second))
