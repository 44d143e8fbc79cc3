"""Means, intervals and spreads, beside SciPy, rliable and all resamples."""

from itertools import product

import numpy as np
import pytest
from rliable import metrics
from scipy import stats
from small_project import COMPARE

from jumping_ant.comparison import estimates
from jumping_ant.comparison.estimates import (
    estimate,
    estimate_iqm,
    estimate_mean,
    pair_scores,
    probability_of_improvement,
)
from jumping_ant.comparison.hypothesis_tests import rank_test

PARAMS = COMPARE.model_copy(update={"bootstrap_samples": 2000})


def mixture(generator, shape):
    """Return seeds as they look: most return 7,500, a fifth fails at 4,000."""
    means = np.where(generator.random(shape) < 0.2, 4000, 7500)
    return generator.normal(means, 300)


def middle_mean(sample):
    """Return the interquartile mean, as SciPy computes it."""
    return stats.trim_mean(sample, 0.25, axis=-1)


SOURCES = {
    "normal": (lambda generator, shape: generator.normal(10.0, 2.0, shape), 10.0),
    "lognormal": (lambda generator, shape: generator.lognormal(0.0, 0.5, shape), None),
    "mixture": (mixture, None),
}


@pytest.mark.parametrize(
    ("sample", "mean"),
    [
        ([7.0], 7.0),
        ([1.0, 2.0, 9.0], 4.0),
        ([1.0, 2.0, 3.0, 1000.0], 2.5),
        ([-50.0, 1.0, 2.0, 3.0, 1000.0], 2.0),
        ([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 100.0], 3.5),
    ],
)
def test_the_interquartile_mean_is_rliables(sample, mean):
    assert estimate_iqm(np.array(sample), 0.95).value == pytest.approx(mean)
    # Theirs pools runs and tasks, whose scores are one column here.
    assert metrics.aggregate_iqm(np.array(sample)[:, None]) == pytest.approx(mean)


def test_the_probability_of_improvement_is_rliables_and_counts_ties_half():
    # 1 beats 0 only; 2 ties twice and beats 0; 3 beats all: 1 + 2 + 3 of 9.
    x, y = np.array([1.0, 2.0, 3.0]), np.array([2.0, 2.0, 0.0])
    assert probability_of_improvement(x, y, PARAMS).value == pytest.approx(6 / 9)
    assert metrics.probability_of_improvement(x[:, None], y[:, None]) == pytest.approx(6 / 9)


@pytest.mark.parametrize(("x", "y"), [([1, 1], [0, 2]), ([0, 2], [1, 1]), ([2], [1, 3])])
def test_the_probability_of_improvement_resamples_both_sides(x, y):
    # Were only the equal ones resampled, each resample would win half of the pairs.
    found = probability_of_improvement(np.array(x), np.array(y), PARAMS)
    assert found.as_dict("p") == {"p": 0.5, "low": 0.0, "high": 1.0}


@pytest.mark.parametrize(
    ("x", "y", "score"),
    [
        ((2, 3), (1, 2), 1.0),  # above 2 is above at most 2
        ((2, 3), (1, 2.5), 0.5),
        ((1, 2), (1, 2), 0.5),
        ((1, 2), (2, 3), 0.0),
        ((0, 1), (3, np.inf), 0.0),  # what never happened takes longer
        ((2, np.inf), (3, 4), 0.5),
        ((4, np.inf), (9, np.inf), 0.5),
    ],
)
def test_pairs_of_bounds_score_what_the_bounds_settle(x, y, score):
    assert pair_scores(np.array([x]), np.array([y])) == pytest.approx(score)


def test_narrow_bounds_are_as_good_as_values():
    x, y = np.array([1.0, 5.0, 7.0]), np.array([6.0, 0.0])
    bounds = [np.stack([own - 0.1, own], axis=1) for own in (x, y)]
    np.testing.assert_array_equal(pair_scores(*bounds), pair_scores(x, y))


def test_the_median_of_all_pairs_is_hodges_and_lehmanns():
    few = np.array([5.0, 9.0]), np.array([1.0, 2.0, 4.0])
    found = estimates.pairwise_median(np.subtract, *few, 0.95)
    assert found.value == 4.5  # of 1 3 4 5 7 8
    assert np.isnan([found.low, found.high]).all()
    ratio = estimates.pairwise_median(np.divide, np.array([6.0]), np.array([2.0, 3.0]), 0.95)
    assert ratio.value == 2.5


def test_its_interval_has_the_shifts_that_the_rank_test_does_not_reject():
    x, y = np.random.default_rng(0).normal(size=(2, 9))
    found = estimates.pairwise_median(np.subtract, x, y, 0.95)
    for end, inward in ((found.low, 1e-9), (found.high, -1e-9)):
        assert rank_test(x, y + end - inward) <= 0.05 < rank_test(x, y + end + inward)
    wide = estimates.pairwise_median(np.subtract, np.repeat(x, 12), np.repeat(y, 12), 0.95)
    assert found.low < wide.low < wide.value < wide.high < found.high  # more seeds, by their limit


@pytest.mark.parametrize(
    ("sample", "spread"),
    [([1.0, 2.0, 6.0], 2.5 / 3), ([4.0], 0.0), ([0.0, 0.0], np.nan), ([-1.0, -3.0], 0.5)],
)
def test_relative_spread(sample, spread):
    assert estimates.relative_spread(np.array(sample)) == pytest.approx(spread, nan_ok=True)


@pytest.mark.parametrize("sample", [[1.0, 2.0, 4.0, 9.0], [-3.0, 0.0, 0.0, 7.0, 11.0]])
def test_standard_errors_are_those_of_all_resamples(sample):
    num = len(sample)
    resamples = np.array(list(product(sample, repeat=num)))  # all are equally likely
    error = middle_mean(resamples).std()
    found = estimate_iqm(np.array(sample), 0.9)
    assert found.high - found.value == pytest.approx(stats.t.ppf(0.95, num - 1) * error)
    assert found.value - found.low == pytest.approx(stats.t.ppf(0.95, num - 1) * error)


@pytest.mark.parametrize(("function", "num_seeds"), [(estimate_mean, 8), (estimate_iqm, 3)])
def test_intervals_of_untrimmed_means_are_students(function, num_seeds):
    sample = np.random.default_rng(2).lognormal(size=num_seeds)
    low, high = stats.ttest_1samp(sample, 0.0).confidence_interval(0.95)
    found = function(sample, 0.95)
    assert (found.value, found.low, found.high) == pytest.approx((sample.mean(), low, high))


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(("num_seeds", "at_most"), [(3, 0.965), (4, 0.975), (8, 0.98), (10, 0.985)])
def test_intervals_cover_the_truth_as_often_as_documented(source, num_seeds, at_most):
    draw, truth = SOURCES[source]
    generator = np.random.default_rng(num_seeds)
    truth = truth or middle_mean(draw(generator, 2_000_000))
    found = estimate_iqm(draw(generator, (10_000, num_seeds)), 0.95)
    covered = np.mean((found.low <= truth) & (found.high >= truth))
    assert 0.94 <= covered <= at_most


def test_percentile_bootstraps_cover_the_truth_less_often():
    samples = np.random.default_rng(1).normal(10.0, 2.0, size=(1000, 4))
    params = PARAMS.model_copy(update={"bootstrap_samples": 500})
    found = estimate(middle_mean, [samples], params)
    assert 0.84 <= np.mean((found.low <= 10.0) & (found.high >= 10.0)) <= 0.92


def test_a_bootstrapped_interval_is_that_of_all_resamples():
    sample = np.array([1.0, 2.0, 4.0, 9.0])
    resamples = np.array(list(product(sample, repeat=4)))  # all 256 are equally likely
    low, high = np.percentile(middle_mean(resamples), [10, 90])
    params = PARAMS.model_copy(update={"confidence": 0.8, "bootstrap_samples": 20000})
    found = estimate(middle_mean, [sample], params)
    assert (found.low, found.high) == (pytest.approx(low), pytest.approx(high))


@pytest.mark.parametrize("sample", [[3.5], [3.5] * 8])
def test_one_seed_and_equal_seeds_have_their_value_as_interval(sample):
    expected = {"iqm": 3.5, "low": 3.5, "high": 3.5}
    assert estimate_iqm(np.array(sample), 0.95).as_dict("iqm") == expected
    assert estimate(middle_mean, [np.array(sample)], PARAMS).as_dict("iqm") == expected


def test_estimates_depend_on_their_seed_alone_and_not_on_the_order():
    generator = np.random.default_rng(4)
    x, y = generator.normal(size=11), generator.normal(size=9)
    few = PARAMS.model_copy(update={"bootstrap_samples": 150})  # so that other draws would show
    mean, pair = estimate(middle_mean, [x], few), probability_of_improvement(x, y, few)
    x, y = generator.permutation(x), generator.permutation(y)
    assert estimate(middle_mean, [x], few) == mean
    assert probability_of_improvement(x, y, few) == pair
    assert estimate(middle_mean, [x], few.model_copy(update={"seed": 1})) != mean


def test_estimates_work_along_the_last_axis():
    samples = np.random.default_rng(0).normal(size=(3, 6))
    for function in (
        lambda own: estimate(middle_mean, [own], PARAMS),
        lambda own: estimate_iqm(own, 0.95),
    ):
        found, one = function(samples), function(samples[1])
        middle = found.value[1], found.low[1], found.high[1]
        np.testing.assert_allclose(middle, (one.value, one.low, one.high), rtol=1e-12)


def test_shares_differ_as_newcombe_has_it():
    x, y = np.repeat([1.0, 0.0], [56, 14]), np.repeat([1.0, 0.0], [48, 32])  # his example (a)
    found = estimates.difference_of_shares(x, y, 0.95)
    assert [found.value, found.low, found.high] == pytest.approx([0.2, 0.0524, 0.3339], abs=5e-5)
