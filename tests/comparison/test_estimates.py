from itertools import product

import numpy as np
import pytest
from rliable import metrics
from scipy import stats
from small_project import COMPARE

from jumping_ant.comparison import estimates as statistics
from jumping_ant.comparison.estimates import (
    estimate,
    estimate_iqm,
    estimate_mean,
    probability_of_improvement,
)

PARAMS = COMPARE.model_copy(update={"bootstrap_samples": 2000})


def mixture(generator, shape):
    """Return seeds as they look: most return 7,500, a fifth fails at 4,000."""
    means = np.where(generator.random(shape) < 0.2, 4000, 7500)
    return generator.normal(means, 300)


def middle_mean(sample, axis=-1):
    """Return the interquartile mean, as SciPy computes it."""
    return stats.trim_mean(sample, 0.25, axis=axis)


SOURCES = {
    "normal": (lambda generator, shape: generator.normal(10.0, 2.0, shape), 10.0),
    "lognormal": (lambda generator, shape: generator.lognormal(0.0, 0.5, shape), None),
    "mixture": (mixture, None),
}


@pytest.mark.parametrize(
    ("sample", "mean"),
    [
        ([7.0], 7.0),
        ([1.0, 3.0], 2.0),
        ([1.0, 2.0, 9.0], 4.0),
        ([1.0, 2.0, 3.0, 1000.0], 2.5),
        ([-50.0, 1.0, 2.0, 3.0, 1000.0], 2.0),
        ([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 100.0], 3.5),
    ],
)
def test_interquartile_mean_of_small_samples(sample, mean):
    assert estimate_iqm(np.array(sample), 0.95).value == pytest.approx(mean)


def test_probability_of_improvement_counts_ties_half():
    # 1 beats 0 only; 2 ties twice and beats 0; 3 beats all: 1 + 2 + 3 of 9.
    x, y = np.array([1.0, 2.0, 3.0]), np.array([2.0, 2.0, 0.0])
    assert probability_of_improvement(x, y, PARAMS).value == pytest.approx(6 / 9)
    assert probability_of_improvement(x, x, PARAMS).value == pytest.approx(0.5)


def test_probability_of_improvement_is_mann_whitneys_u():
    generator = np.random.default_rng(3)
    x, y = generator.integers(0, 6, 7).astype(float), generator.integers(0, 6, 5).astype(float)
    u = stats.mannwhitneyu(x, y).statistic
    assert probability_of_improvement(x, y, PARAMS).value == pytest.approx(u / (7 * 5))


def test_probability_of_improvement_resamples_both_sides():
    # Were only x resampled, each resample would win 0.5 of the pairs and the interval were a point.
    interval = probability_of_improvement(np.array([1.0, 1.0]), np.array([0.0, 2.0]), PARAMS)
    assert (interval.low, interval.high) == (0.0, 1.0)
    interval = probability_of_improvement(np.array([0.0, 2.0]), np.array([1.0, 1.0]), PARAMS)
    assert (interval.low, interval.high) == (0.0, 1.0)


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
    assert statistics.pair_scores(np.array([x]), np.array([y])) == pytest.approx(score)


def test_narrow_bounds_are_as_good_as_values():
    x, y = np.array([1.0, 5.0, 7.0]), np.array([6.0, 0.0])
    bounds = [np.stack([own - 0.1, own], axis=1) for own in (x, y)]
    np.testing.assert_array_equal(statistics.pair_scores(*bounds), statistics.pair_scores(x, y))


def test_the_median_of_all_pairs_is_hodges_and_lehmanns():
    difference = statistics.pairwise_median(np.subtract)
    assert difference(np.array([5.0, 9.0]), np.array([1.0, 2.0, 4.0])) == 4.5  # of 1 3 4 5 7 8
    assert statistics.pairwise_median(np.divide)(np.array([6.0]), np.array([2.0, 3.0])) == 2.5


@pytest.mark.parametrize(
    ("sample", "spread"),
    [([1.0, 2.0, 6.0], 2.5 / 3), ([4.0], 0.0), ([0.0, 0.0], np.nan), ([-1.0, -3.0], 0.5)],
)
def test_relative_spread(sample, spread):
    assert statistics.relative_spread(np.array(sample)) == pytest.approx(spread, nan_ok=True)


@pytest.mark.parametrize("num_seeds", [1, 4, 8, 9, 10])
def test_interquartile_mean_is_rliables(num_seeds):
    # Theirs pools runs and tasks, whose scores are one column here.
    sample = np.random.default_rng(num_seeds).normal(size=num_seeds)
    theirs = metrics.aggregate_iqm(sample[:, None])
    assert estimate_iqm(sample, 0.95).value == pytest.approx(theirs)


def test_probability_of_improvement_is_rliables():
    generator = np.random.default_rng(8)
    x, y = generator.integers(0, 9, 8).astype(float), generator.integers(2, 11, 8).astype(float)
    theirs = metrics.probability_of_improvement(x[:, None], y[:, None])
    assert probability_of_improvement(x, y, PARAMS).value == pytest.approx(theirs)


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


def test_interval_is_that_of_all_resamples():
    sample = np.array([1.0, 2.0, 4.0, 9.0])
    resamples = np.array(list(product(sample, repeat=4)))  # all 256 are equally likely
    low, high = np.percentile(middle_mean(resamples), [10, 90])
    params = PARAMS.model_copy(update={"confidence": 0.8, "bootstrap_samples": 20000})
    found = estimate(middle_mean, [sample], params)
    assert (found.low, found.high) == (pytest.approx(low), pytest.approx(high))


def test_more_confidence_and_fewer_seeds_mean_wider_intervals():
    many = np.random.default_rng(0).normal(size=40)

    def width(sample, confidence):
        found = estimate_iqm(sample, confidence)
        return found.high - found.low

    assert width(many, 0.5) < width(many, 0.95) < width(many[:8], 0.95)


def test_one_seed_and_equal_seeds_have_their_value_as_interval():
    found = estimate_iqm(np.array([3.5]), 0.95)
    assert found.as_dict("iqm") == {"iqm": 3.5, "low": 3.5, "high": 3.5}
    found = estimate_iqm(np.full(8, 7.0), 0.95)
    assert found.as_dict("iqm") == {"iqm": 7.0, "low": 7.0, "high": 7.0}
    found = probability_of_improvement(np.array([2.0]), np.array([1.0]), PARAMS)
    assert found.as_dict("p") == {"p": 1.0, "low": 1.0, "high": 1.0}


def test_one_seed_against_several_varies_with_the_several():
    found = probability_of_improvement(np.array([2.0]), np.array([1.0, 3.0]), PARAMS)
    assert found.as_dict("p") == {"p": 0.5, "low": 0.0, "high": 1.0}


def test_estimates_depend_neither_on_the_order_nor_on_the_run():
    generator = np.random.default_rng(4)
    x, y = generator.normal(size=11), generator.normal(size=9)
    few = PARAMS.model_copy(update={"bootstrap_samples": 150})  # so that other draws would show
    mean, pair = estimate(middle_mean, [x], few), probability_of_improvement(x, y, few)
    assert estimate(middle_mean, [x], few) == mean
    assert probability_of_improvement(x, y, few) == pair
    for _ in range(5):
        x, y = generator.permutation(x), generator.permutation(y)
        assert estimate(middle_mean, [x], few) == mean
        assert probability_of_improvement(x, y, few) == pair


def test_estimates_follow_their_seed():
    sample = np.random.default_rng(0).normal(size=12)
    lows = {
        float(estimate(middle_mean, [sample], PARAMS.model_copy(update={"seed": seed})).low)
        for seed in range(4)
    }
    assert len(lows) > 1


def test_estimates_work_along_the_last_axis():
    samples = np.random.default_rng(0).normal(size=(3, 6))
    for found, one in (
        (
            estimate(middle_mean, [samples], PARAMS),
            estimate(middle_mean, [samples[1]], PARAMS),
        ),
        (estimate_iqm(samples, 0.95), estimate_iqm(samples[1], 0.95)),
    ):
        assert found.value.shape == (3,)
        middle = found.value[1], found.low[1], found.high[1]
        np.testing.assert_allclose(middle, (one.value, one.low, one.high), rtol=1e-12)


def test_curves_with_common_positions_are_compared_there():
    positions = np.array([10.0, 25.0, 70.0])
    np.testing.assert_array_equal(statistics.common_grid([positions, positions]), positions)


def test_other_curves_are_compared_between_the_last_start_and_the_last_end():
    grid = statistics.common_grid([np.array([0.0, 5.0, 9.0]), np.array([4.0, 10.0])])
    np.testing.assert_allclose(grid, [4.0, 7.0, 10.0])


def test_aggregated_curves_interpolate_and_hold_the_last_value():
    short = np.array([0.0, 10.0]), np.array([0.0, 100.0])
    long = np.array([0.0, 20.0]), np.array([100.0, 300.0])
    found = statistics.aggregate_curves(np.array([0.0, 5.0, 20.0]), [short, long], 0.95)
    np.testing.assert_allclose(found.value, [50.0, 100.0, 200.0])
    middle = estimate_iqm(np.array([50.0, 150.0]), 0.95)
    assert (found.low[1], found.high[1]) == pytest.approx((middle.low, middle.high))
