"""Statistics of a handful of training seeds: means, intervals, spreads.

The sample is one number per seed (the mean over its episodes), never seeds x episodes, because the
episodes of one policy say nothing about what another seed would have learned.

Sources: Agarwal et al., "Deep Reinforcement Learning at the Edge of the Statistical Precipice",
NeurIPS 2021 (section 4: interquartile mean, probability of improvement); Hutson and Ernst, "The
exact bootstrap mean and variance of an L-estimator", Journal of the Royal Statistical Society B
62, 2000; Efron and Tibshirani, "An Introduction to the Bootstrap", 1993, chapters 12 and 13 (t and
percentile intervals); Mann and Whitney, Annals of Mathematical Statistics 18, 1947, and Mantel,
Biometrics 23, 1967 (scores of pairs of values, and of bounds); Hodges and Lehmann, Annals of
Mathematical Statistics 34, 1963 (medians of pairs and their intervals); Brown and Forsythe, Journal
of the American Statistical Association 69, 1974 (spread); Newcombe, "Interval estimation for the
difference between independent proportions", Statistics in Medicine 17, 1998 (method 10).
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from jumping_ant.params.blocks import CompareParams

Array = NDArray[np.float64]

BATCH = 500  # resamples held in memory at once
MOST_PAIRS = 10_000  # of two samples whose deals are counted exactly
QUARTER = 0.25  # of the sample; the interquartile mean leaves it out at either end


@dataclass(frozen=True)
class Estimate:
    """A statistic with the ends of its interval; the three arrays have one shape, () for one."""

    value: Array
    low: Array
    high: Array

    def as_dict(self, name: str) -> dict[str, float]:
        """Return plain numbers for JSON, the value under this name."""
        return {name: float(self.value), "low": float(self.low), "high": float(self.high)}


def estimate_iqm(samples: Array, confidence: float) -> Estimate:
    """Return the interquartile mean with a t interval on its exact bootstrap standard error.

    Whole observations are left out, `n // 4` at each end, as in the reference implementation of
    Agarwal et al. 2021.

    The interval is `iqm -+ t * se` (Efron and Tibshirani 1993, chapter 12): t is the quantile of
    Student's distribution with n - 1 degrees of freedom, and se the standard deviation of the
    interquartile mean over all n^n resamples (Hutson and Ernst 2000). Of one observation, or of
    equal ones, it is the value. docs/measures-and-claims.md has its coverage.

    Args:
        samples: Observations along the last axis, shape (..., n).
        confidence: Nominal coverage.

    Returns:
        The estimate, its arrays of shape (...).
    """
    return _t_interval(samples, int(QUARTER * samples.shape[-1]), confidence)


def estimate_mean(samples: Array, confidence: float) -> Estimate:
    """Return the mean with Student's t interval; shapes are those of `estimate_iqm`."""
    return _t_interval(samples, 0, confidence)


def _t_interval(samples: Array, cut: int, confidence: float) -> Estimate:
    """Return the mean without `cut` observations at either end, and its t interval."""
    ordered = np.sort(samples, axis=-1)
    num = ordered.shape[-1]
    value = ordered[..., cut : num - cut].mean(axis=-1)
    gaps = np.diff(ordered, axis=-1)
    variance = np.einsum("...i,ij,...j", gaps, _gap_weights(num, cut), gaps)
    if cut == 0 and num > 1:  # as Student's interval does; trimmed means need no correction
        variance *= num / (num - 1)
    quantile = stats.t.ppf((1 + confidence) / 2, max(num - 1, 1))
    half = quantile * np.sqrt(np.maximum(variance, 0.0))
    return Estimate(value, value - half, value + half)


@lru_cache
def _gap_weights(num: int, cut: int) -> Array:
    """Return W, (num - 1, num - 1): gaps @ W @ gaps is the bootstrap variance of a trimmed mean.

    The trimmed mean of a resample is the largest observation minus each gap between neighbours in
    the sample times the share of kept observations below that gap. That share depends on how many
    of the resample's observations are among the i smallest of the sample, a count that is binomial
    and a Markov chain in i (Hutson and Ernst 2000). W holds the covariances of the shares.
    """
    counts = np.arange(num + 1)
    share = (np.clip(counts, cut, num - cut) - cut) / (num - 2 * cut)
    chances = stats.binom.pmf(counts, num, np.arange(1, num)[:, None] / num)
    means = chances @ share
    more, left = counts - counts[:, None], num - counts[:, None]
    # From a count among the i smallest to one among the i + 1 smallest.
    steps = [stats.binom.pmf(more, left, 1 / (num - i)) for i in range(1, num - 1)]
    weights = np.zeros((num - 1, num - 1))
    for j in range(num - 1):
        expected = share  # of gap j, by the count below gap i
        for i in range(j, -1, -1):
            weights[i, j] = weights[j, i] = chances[i] @ (share * expected) - means[i] * means[j]
            expected = steps[i - 1] @ expected if i else expected
    return weights


def pair_scores(x: Array, y: Array) -> Array:
    """Return 1 where x beats y, 0.5 where they tie and 0 where y beats x, (num_x, num_y).

    Samples are values, (num_x,) and (num_y,) (Mann and Whitney 1947), or bounds, (num_x, 2) and
    (num_y, 2), with `low` < value <= `high`; a pair that these leave undecided ties (Mantel 1967).
    """
    if x.ndim == 1:
        wins, losses = np.greater.outer(x, y), np.less.outer(x, y)
    else:
        wins = np.greater_equal.outer(x[:, 0], y[:, 1])
        losses = np.less_equal.outer(x[:, 1], y[:, 0])
    return np.asarray(0.5 * (1.0 + wins - losses), dtype=np.float64)


def relative_deviations(samples: Array) -> Array:
    """Return |x - m| / |m| of observations along the last axis, m their median; NaN where m is 0.

    Brown and Forsythe 1974 have |x - m|.
    """
    median = np.median(samples, axis=-1, keepdims=True)
    return np.abs(samples - median) / np.where(median == 0, np.nan, np.abs(median))


def relative_spread(samples: Array) -> Array:
    """Return the mean of `relative_deviations`; 0 for a single observation, NaN for a median 0."""
    return np.asarray(relative_deviations(samples).mean(axis=-1))


def estimate(
    statistic: Callable[..., Array], samples: Sequence[Array], params: CompareParams
) -> Estimate:
    """Return a statistic of one or more samples with its percentile bootstrap interval.

    For statistics without an interval formula (Efron and Tibshirani 1993, chapter 13). With few
    observations the interval is too narrow (docs/measures-and-claims.md); no verdict depends on it.
    The order of the observations does not matter.

    Args:
        statistic: Takes the samples and reduces their last axis. It must not change when all
            observations of a sample are duplicated.
        samples: Observations along the last axis, shapes (..., num_observations); each sample is
            resampled independently.
        params: Confidence, number of resamples and seed.

    Returns:
        The estimate, its arrays of shape (...).
    """
    # Resamples are drawn by position: sorting makes them independent of the order given.
    ordered = [np.sort(np.asarray(sample, dtype=np.float64), axis=-1) for sample in samples]
    value = np.asarray(statistic(*ordered))
    # SciPy rejects a sample of one; a duplicated one still only resamples to itself.
    ordered = [np.repeat(s, 2, axis=-1) if s.shape[-1] == 1 else s for s in ordered]
    with warnings.catch_warnings():
        # If the statistic of a resample is NaN, so is the interval.
        warnings.simplefilter("ignore", stats.DegenerateDataWarning)
        interval = stats.bootstrap(
            ordered,
            lambda *resamples, axis: statistic(*resamples),  # SciPy moves the axis to the end
            n_resamples=params.bootstrap_samples,
            batch=BATCH,
            vectorized=True,
            axis=-1,
            confidence_level=params.confidence,
            method="percentile",
            rng=np.random.default_rng(params.seed),
        ).confidence_interval
    return Estimate(value, np.asarray(interval.low), np.asarray(interval.high))


def probability_of_improvement(x: Array, y: Array, params: CompareParams) -> Estimate:
    """Estimate the probability that x beats y, a tie counting half: Mann and Whitney's U / (nm).

    As in section 4 of Agarwal et al. 2021, with a percentile bootstrap interval. Shapes and bounds
    are those of `pair_scores`.
    """
    scores = pair_scores(*(np.sort(one) if one.ndim == 1 else one for one in (x, y)))

    def mean(rows: Array, columns: Array) -> Array:
        rows, columns = rows.astype(np.intp), columns.astype(np.intp)
        return np.asarray(scores[rows[..., :, None], columns[..., None, :]].mean(axis=(-2, -1)))

    return estimate(mean, [np.arange(size, dtype=np.float64) for size in scores.shape], params)


def pairwise_median(
    combine: Callable[[Array, Array], Array], x: Array, y: Array, confidence: float
) -> Estimate:
    """Return the median over all pairs of what they combine to, and the interval of the rank test.

    Of differences, these are the shifts of y that the test does not reject, between two order
    statistics of the pairs (Hodges and Lehmann 1963); of ratios, the factors. NaN where samples are
    too small for an interval.
    """
    pairs = np.sort(combine(x[:, None], y), axis=None)
    sums, chances = deals(np.arange(len(x) + len(y)), len(x))  # of ranks, in samples without ties
    won = sums - len(x) * (len(x) - 1) // 2  # pairs
    rejected = won[np.cumsum(chances) <= (1 - confidence) / 2]
    out = int(rejected[-1]) + 1 if len(rejected) else 0
    ends = (pairs[out - 1], pairs[-out]) if out else (np.nan, np.nan)
    return Estimate(np.asarray(np.median(pairs)), *map(np.asarray, ends))


def difference_of_shares(x: Array, y: Array, confidence: float) -> Estimate:
    """Return the share of ones in x less that in y, with Newcombe's interval of Wilson's scores."""
    ends = [
        stats.binomtest(int(own.sum()), len(own)).proportion_ci(confidence, "wilson")
        for own in (x, y)
    ]
    one, other = x.mean(), y.mean()
    below = np.hypot(one - ends[0].low, ends[1].high - other)
    above = np.hypot(ends[0].high - one, other - ends[1].low)
    value = one - other
    return Estimate(*map(np.asarray, (value, value - below, value + above)))


def deals(scores: NDArray[np.int64], num: int) -> tuple[NDArray[np.int64], Array]:
    """Return the sums that `num` of the scores may have, in order, and the chance of each.

    Every choice is as likely. Up to `MOST_PAIRS` the chances are exact; of larger samples they are
    those of a normal distribution (Mann and Whitney 1947).
    """
    others = len(scores) - num
    if num * others > MOST_PAIRS:
        deviation = np.sqrt(scores.var(ddof=1) * num * others / len(scores))
        sums = np.rint(num * scores.mean() + np.arange(-10 * deviation, 10 * deviation)).astype(int)
        chances = stats.norm.pdf(sums, num * scores.mean(), deviation)
    else:
        shifted = scores - scores.min()
        most = int(np.sort(shifted)[others:].sum())
        ways = np.zeros((num + 1, most + 1))
        ways[0, 0] = 1.0
        for score in shifted:  # is chosen last, or not at all
            for count in range(num, 0, -1):
                ways[count, score:] += ways[count - 1, : most + 1 - score]
        sums, chances = np.arange(most + 1) + num * scores.min(), ways[num]
    return sums, chances / chances.sum()
