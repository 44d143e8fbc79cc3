from itertools import combinations, product

import numpy as np
import pytest
from scipy import stats

from jumping_ant import statistics
from jumping_ant.params import CompareParams
from jumping_ant.statistics import estimate, interquartile_mean, probability_of_improvement

PARAMS = CompareParams(confidence=0.95, bootstrap_samples=2000, seed=0)


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
    assert interquartile_mean(np.array(sample)) == pytest.approx(mean)


def test_interquartile_mean_reduces_the_axis_asked_for():
    table = np.array([[1.0, 10.0], [2.0, 20.0], [3.0, 30.0], [90.0, 900.0]])
    np.testing.assert_allclose(interquartile_mean(table, axis=0), [2.5, 25.0])


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
    ("x", "x_exact", "y", "y_exact", "score"),
    [
        (3, True, 2, True, 1.0),
        (2, True, 2, True, 0.5),
        (1, True, 2, True, 0.0),
        (3, False, 2, True, 1.0),  # later than 3 is later than 2
        (2, False, 2, True, 1.0),  # not by 2 is later than at 2
        (1, False, 2, True, 0.5),  # later than 1 may be before 2 or after
        (2, True, 1, False, 0.5),
        (2, True, 2, False, 0.0),
        (3, False, 2, False, 0.5),
    ],
)
def test_bounded_pairs_score_what_the_bounds_settle(x, x_exact, y, y_exact, score):
    arrays = np.array([float(x)]), np.array([x_exact]), np.array([float(y)]), np.array([y_exact])
    assert statistics.bounded_pair_scores(*arrays) == pytest.approx(score)


def test_bounded_pairs_without_bounds_are_plain_pairs():
    x, y, yes = np.array([1.0, 5.0, 5.0]), np.array([5.0, 0.0]), np.array([True, True, True])
    np.testing.assert_array_equal(
        statistics.bounded_pair_scores(x, yes, y, yes[:2]), statistics.pair_scores(x, y)
    )


def test_mean_pair_score_weighs_opponents_alike():
    many, few = np.ones((3, 10)), np.zeros((3, 2))
    assert statistics.mean_pair_score([many, few], PARAMS).value == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("sample", "variation"),
    [([1.0, 3.0], 0.5), ([4.0], 0.0), ([0.0, 0.0], np.nan), ([-1.0, -3.0], 0.5)],
)
def test_coefficient_of_variation(sample, variation):
    found = statistics.coefficient_of_variation(np.array(sample))
    assert found == pytest.approx(variation, nan_ok=True)


def test_interval_is_that_of_all_resamples():
    sample = np.array([1.0, 2.0, 4.0, 9.0])
    resamples = np.array(list(product(sample, repeat=4)))  # all 256 are equally likely
    low, high = np.percentile(interquartile_mean(resamples), [10, 90])
    params = CompareParams(confidence=0.8, bootstrap_samples=20000, seed=5)
    found = estimate(interquartile_mean, [sample], params)
    assert (found.low, found.high) == (pytest.approx(low), pytest.approx(high))


@pytest.mark.parametrize(("num_seeds", "at_least", "at_most"), [(20, 0.91, 0.97), (4, 0.84, 0.92)])
def test_intervals_cover_the_truth_as_often_as_documented(num_seeds, at_least, at_most):
    samples = np.random.default_rng(1).normal(10.0, 2.0, size=(1000, num_seeds))
    found = estimate(
        interquartile_mean, [samples], PARAMS.model_copy(update={"bootstrap_samples": 500})
    )
    covered = np.mean((found.low <= 10.0) & (found.high >= 10.0))
    assert at_least <= covered <= at_most


def test_more_confidence_and_fewer_seeds_mean_wider_intervals():
    generator = np.random.default_rng(0)
    many = generator.normal(size=40)

    def width(sample, confidence):
        params = PARAMS.model_copy(update={"confidence": confidence})
        found = estimate(interquartile_mean, [sample], params)
        return found.high - found.low

    assert width(many, 0.5) < width(many, 0.95) < width(many[:8], 0.95)


def test_one_seed_has_its_value_as_interval():
    found = estimate(interquartile_mean, [np.array([3.5])], PARAMS)
    assert found.as_dict("iqm") == {"iqm": 3.5, "low": 3.5, "high": 3.5}
    found = probability_of_improvement(np.array([2.0]), np.array([1.0]), PARAMS)
    assert found.as_dict("p") == {"p": 1.0, "low": 1.0, "high": 1.0}


def test_one_seed_against_several_varies_with_the_several():
    found = probability_of_improvement(np.array([2.0]), np.array([1.0, 3.0]), PARAMS)
    assert found.as_dict("p") == {"p": 0.5, "low": 0.0, "high": 1.0}


def test_estimates_depend_neither_on_the_order_nor_on_the_run():
    generator = np.random.default_rng(4)
    x, y = generator.normal(size=11), generator.normal(size=9)
    few = PARAMS.model_copy(update={"bootstrap_samples": 150})  # so that other draws would show
    mean, pair = estimate(interquartile_mean, [x], few), probability_of_improvement(x, y, few)
    assert estimate(interquartile_mean, [x], few) == mean
    assert probability_of_improvement(x, y, few) == pair
    for _ in range(5):
        x, y = generator.permutation(x), generator.permutation(y)
        assert estimate(interquartile_mean, [x], few) == mean
        assert probability_of_improvement(x, y, few) == pair


def test_estimates_follow_their_seed():
    sample = np.random.default_rng(0).normal(size=12)
    lows = {
        float(estimate(interquartile_mean, [sample], PARAMS.model_copy(update={"seed": seed})).low)
        for seed in range(4)
    }
    assert len(lows) > 1


def test_estimates_work_along_the_last_axis():
    samples = np.random.default_rng(0).normal(size=(3, 6))
    found = estimate(interquartile_mean, [samples], PARAMS)
    for row, sample in enumerate(samples):
        single = estimate(interquartile_mean, [sample], PARAMS)
        assert (found.value[row], found.low[row], found.high[row]) == (
            single.value, single.low, single.high,
        )  # fmt: skip


@pytest.mark.parametrize(
    ("num_x", "num_y", "confidence", "enough"),
    [
        (1, 1, 0.95, False),
        (3, 3, 0.95, False),  # separated by chance in 2 of 20
        (4, 4, 0.95, True),  # in 2 of 70
        (3, 3, 0.90, True),
        (4, 4, 0.99, False),
        (2, 20, 0.95, True),
    ],
)
def test_how_many_seeds_a_verdict_needs(num_x, num_y, confidence, enough):
    assert statistics.enough_seeds(num_x, num_y, confidence) is enough


@pytest.mark.parametrize(("num_seeds", "false_alarms"), [(2, 2), (3, 4), (4, 4)])
def test_how_often_intervals_tell_equal_agents_apart(num_seeds, false_alarms):
    # Of equal agents every order of the returns is equally likely: 6, 20 and 70 for 2, 3, 4 seeds.
    ranks = set(range(2 * num_seeds))
    found = 0
    for own in combinations(ranks, num_seeds):
        x, y = np.array(own, dtype=float), np.array(sorted(ranks - set(own)), dtype=float)
        interval = probability_of_improvement(x, y, PARAMS)
        found += bool(interval.low > 0.5 or interval.high < 0.5)
    assert found == false_alarms


def test_curves_with_common_positions_are_compared_there():
    positions = np.array([10.0, 25.0, 70.0])
    np.testing.assert_array_equal(statistics.common_grid([positions, positions]), positions)


def test_other_curves_are_compared_between_the_last_start_and_the_last_end():
    grid = statistics.common_grid([np.array([0.0, 5.0, 9.0]), np.array([4.0, 10.0])])
    np.testing.assert_allclose(grid, [4.0, 7.0, 10.0])


def test_aggregated_curves_interpolate_and_hold_the_last_value():
    short = np.array([0.0, 10.0]), np.array([0.0, 100.0])
    long = np.array([0.0, 20.0]), np.array([100.0, 300.0])
    found = statistics.aggregate_curves(np.array([0.0, 5.0, 20.0]), [short, long], PARAMS)
    np.testing.assert_allclose(found.value, [50.0, 100.0, 200.0])
    np.testing.assert_allclose(found.low, [0.0, 50.0, 100.0])
    np.testing.assert_allclose(found.high, [100.0, 150.0, 300.0])
