import numpy as np
import pytest
from scipy import stats

from jumping_ant.comparison import hypothesis_tests, sample_sizes
from jumping_ant.comparison.hypothesis_tests import holm, rank_test, sign_test, spread_test

GENERATOR = np.random.default_rng(0)
X, Y = GENERATOR.normal(0.6, 1.0, 8), GENERATOR.normal(0.0, 1.0, 6)
TIES = np.array([1.0, 2.0, 2.0, 5.0, 5.0]), np.array([0.0, 1.0, 1.0, 2.0])


def test_rank_test_is_mann_whitneys():
    theirs = stats.mannwhitneyu(X, Y, method="exact").pvalue
    assert rank_test(X, Y, 0).p == pytest.approx(theirs)
    assert rank_test(Y, X, 0).p == pytest.approx(theirs)


def test_rank_test_with_ties_looks_at_every_arrangement():
    def distance(x, y, axis=-1):  # of the pairs won from half of them
        return np.abs(stats.mannwhitneyu(x, y, axis=axis, method="asymptotic").statistic - 10)

    every = stats.permutation_test(
        TIES, distance, vectorized=True, alternative="greater", n_resamples=np.inf
    )
    assert rank_test(*TIES, 0).p == pytest.approx(every.pvalue)


def test_bounds_that_settle_nothing_are_no_evidence():
    low, high = np.arange(4.0), np.arange(4.0) + 10
    known, bound = np.ones(4, dtype=bool), np.zeros(4, dtype=bool)
    assert rank_test(low, high, 0).p == pytest.approx(2 / 70)
    # What is above 0 may be above 10 or not, but what is above 10 is above 0.
    assert rank_test(low, high, 0, x_exact=bound).p == 1.0
    assert rank_test(low, high, 0, y_exact=bound).p == pytest.approx(2 / 70)
    assert "Gehan" in rank_test(low, high, 0, known, bound).test


@pytest.mark.parametrize("sample", [X, X - 2.0, np.array([1.0, 1.0, -1.0, 3.0, 0.0])])
def test_sign_test_looks_at_every_sign(sample):
    theirs = stats.permutation_test(
        [sample], lambda x, axis: x.sum(axis), permutation_type="samples", n_resamples=np.inf
    )
    assert sign_test(sample, 0).p == pytest.approx(theirs.pvalue)


def test_eight_seeds_that_agree_have_the_smallest_p_values():
    low, high = np.arange(8.0), np.arange(8.0) + 100
    assert (rank_test(low, high, 0).p, rank_test(low, high, 0).smallest_p) == (2 / 12870, 2 / 12870)
    assert (sign_test(high, 0).p, sign_test(high, 0).smallest_p) == (2 / 256, 2 / 256)


@pytest.mark.parametrize("num", [1, 2])
def test_one_or_two_seeds_are_no_evidence(num):
    low, high = np.arange(1.0, num + 1), np.arange(1.0, num + 1) + 100
    for test in (rank_test(low, high, 0), spread_test(low, high, 0), sign_test(high, 0)):
        assert test.p >= test.smallest_p > 0.05


@pytest.mark.parametrize("test", [rank_test, spread_test])
def test_random_arrangements_stand_for_all_where_there_are_too_many(test, monkeypatch):
    x, y = 5 + 2 * X, 5 + 0.3 * np.append(Y, [0.1, 0.2])
    every = test(x, y, 0).p
    monkeypatch.setattr(hypothesis_tests, "MOST", 10_000)
    some = test(x, y, 0)
    assert some.p == pytest.approx(every, abs=0.01)
    assert some.p == test(x, y, 0).p != test(x, y, 1).p
    assert some.smallest_p == 2 / 12870


def test_random_signs_stand_for_all_where_there_are_too_many():
    sample = GENERATOR.normal(0.5, 1.0, 30)
    found = sign_test(sample, 0)
    assert found.p == pytest.approx(stats.ttest_1samp(sample, 0.0).pvalue, abs=0.01)
    assert found.smallest_p == 1 / hypothesis_tests.MOST


def test_spread_is_relative_to_the_median():
    shape = np.array([-1.0, -0.8, -0.5, 0.1, 0.4, 0.6, 0.9, 1.2])
    small, large = 100 * (1 + 0.01 * shape), 1 + 0.5 * shape
    assert spread_test(small, large, 0).p < 0.001
    assert spread_test(small, 7 * small, 0).p == pytest.approx(1.0)


def test_spread_around_nothing_is_no_evidence():
    assert spread_test(np.zeros(8), np.arange(8.0), 0).p == 1.0
    # Here the median of some arrangements is 0.
    mixed = np.array([-1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    assert 0 < spread_test(mixed, mixed, 0).p <= 1.0


@pytest.mark.parametrize(
    ("draw", "at_most"),
    [
        (lambda generator: generator.normal(10.0, 1.0, 8), 0.07),
        (lambda generator: generator.lognormal(0.0, 0.5, 8), 0.07),
        (lambda generator: generator.choice([4000, 7500], 8, p=[0.2, 0.8])
         + generator.normal(0, 300, 8), 0.12),
    ],
    ids=["normal", "lognormal", "mixture"],
)  # fmt: skip
def test_equal_spreads_are_told_apart_as_often_as_documented(draw, at_most):
    generator = np.random.default_rng(3)
    found = [spread_test(draw(generator), 7 * draw(generator), 0).p <= 0.05 for _ in range(400)]
    assert 0.005 <= np.mean(found) <= at_most


def test_a_joint_claim_is_as_sure_as_the_least_sure_of_its_parts():
    weak, strong = rank_test(X, Y, 0), rank_test(X + 9, Y, 0)
    assert hypothesis_tests.joint([strong, weak, strong]) == weak


@pytest.mark.parametrize(
    ("p_values", "corrected"),
    [
        ([0.01, 0.04, 0.03, 0.005], [0.03, 0.06, 0.06, 0.02]),  # by hand; 0.04 stays above 0.03
        ([0.4, 0.6], [0.8, 0.8]),
        ([0.9, 0.8], [1.0, 1.0]),
        ([0.02], [0.02]),
        ([], []),
    ],
)
def test_holms_correction(p_values, corrected):
    assert holm(p_values) == pytest.approx(corrected)


def test_holm_rejects_a_true_hypothesis_no_more_often_than_promised():
    generator = np.random.default_rng(5)
    families = generator.random((4000, 10))
    assert 0.03 <= np.mean([min(holm(family)) <= 0.05 for family in families]) <= 0.06


@pytest.mark.parametrize("shift", [1.0, 1.5])
def test_rank_tests_of_the_seeds_advised_have_the_power_asked_for(shift):
    generator = np.random.default_rng(1)
    num = sample_sizes.for_rank_test(stats.norm.cdf(shift / np.sqrt(2)), 0.05, 0.8)
    x, y = generator.normal(shift, 1, (1000, num)), generator.normal(0, 1, (1000, num))
    p = stats.mannwhitneyu(x, y, axis=-1, method="exact").pvalue
    assert 0.75 <= np.mean(p <= 0.05) <= 0.9


def test_sign_tests_of_the_seeds_advised_have_the_power_asked_for():
    generator = np.random.default_rng(1)
    like = stats.zscore(np.arange(8.0), ddof=1) + 1.0  # mean 1, deviation 1
    num = sample_sizes.for_sign_test(like, 0.05, 0.8)
    found = [sign_test(generator.normal(1.0, 1.0, num), 0).p <= 0.05 for _ in range(500)]
    assert 0.75 <= np.mean(found) <= 0.88


def test_spread_tests_of_the_seeds_advised_have_the_power_asked_for():
    generator = np.random.default_rng(1)
    small, large = generator.normal(1, 0.05, 4000), generator.normal(1, 0.4, 4000)
    num = sample_sizes.for_spread_test(small, large, 0.05, 0.8)
    found = [
        spread_test(generator.choice(small, num), generator.choice(large, num), 0).p <= 0.05
        for _ in range(150)
    ]
    assert 0.65 <= np.mean(found) <= 0.95


def test_more_seeds_are_needed_for_less():
    for level in (0.05, 0.001):
        needed = [sample_sizes.for_rank_test(p, level, 0.8) for p in (1.0, 0.9, 0.7, 0.6)]
        assert needed == sorted(needed)
    assert sample_sizes.for_rank_test(0.7, 0.05, 0.9) > sample_sizes.for_rank_test(0.7, 0.05, 0.8)


def test_no_fewer_seeds_are_advised_than_can_decide():
    same = np.ones(4)
    assert sample_sizes.for_sign_test(same, 0.05 / 20, 0.8) == 10  # 2 / 2^9 is more than 0.0025
    assert sample_sizes.for_rank_test(1.0, 0.05, 0.999999) >= 4


@pytest.mark.parametrize(
    "needed",
    [
        sample_sizes.for_rank_test(0.5, 0.05, 0.8),
        sample_sizes.for_rank_test(0.501, 0.05, 0.8),
        sample_sizes.for_sign_test(np.array([-1.0, 1.0]), 0.05, 0.8),
        sample_sizes.for_spread_test(X, X, 0.05, 0.8),
    ],
)
def test_no_number_of_seeds_decides_where_nothing_differs(needed):
    assert needed is None
