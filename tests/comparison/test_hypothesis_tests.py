import math
from functools import partial

import numpy as np
import pytest
from scipy import stats

from jumping_ant.comparison import hypothesis_tests
from jumping_ant.comparison.estimates import relative_deviations, relative_spread
from jumping_ant.comparison.hypothesis_tests import (
    equivalence,
    excess_spread_test,
    rank_test,
    sign_test,
    spread_test,
)

GENERATOR = np.random.default_rng(0)
X, Y = GENERATOR.normal(0.6, 1.0, 8), GENERATOR.normal(0.0, 1.0, 6)
TIES = np.array([1.0, 2.0, 2.0, 5.0, 5.0]), np.array([0.0, 1.0, 1.0, 2.0])


SIDES = ["two-sided", "greater", "less"]


@pytest.mark.parametrize("side", SIDES)
def test_rank_test_is_mann_whitneys(side):
    theirs = stats.mannwhitneyu(X, Y, method="exact", alternative=side).pvalue
    assert rank_test(X, Y, side) == pytest.approx(theirs)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("sample", [X, X - 2.0, np.array([1.0, 1.0, -1.0, 3.0, 0.0])])
def test_sign_test_looks_at_every_sign(sample, side):
    theirs = stats.permutation_test(
        [sample],
        lambda x, axis: x.sum(axis),
        permutation_type="samples",
        alternative=side,
        n_resamples=np.inf,
    )
    assert sign_test(sample, 0, side) == pytest.approx(theirs.pvalue)


def test_rank_test_with_ties_looks_at_every_arrangement():
    def distance(x, y, axis=-1):  # of the pairs won from half of them
        return np.abs(stats.mannwhitneyu(x, y, axis=axis, method="asymptotic").statistic - 10)

    every = stats.permutation_test(
        TIES, distance, vectorized=True, alternative="greater", n_resamples=np.inf
    )
    assert rank_test(*TIES) == pytest.approx(every.pvalue)


def test_bounds_that_settle_nothing_are_no_evidence():
    low, high = np.arange(4.0), np.arange(4.0) + 10
    exact, bound = (
        lambda own: np.stack([own - 0.1, own], axis=1),
        lambda own: np.stack([own, np.full(4, np.inf)], axis=1),
    )
    assert rank_test(exact(low), exact(high)) == pytest.approx(2 / 70)
    # What is above 0 may be above 10 or not, but what is above 10 is above 0.
    assert rank_test(bound(low), exact(high)) == 1.0
    assert rank_test(exact(low), bound(high)) == pytest.approx(2 / 70)


def test_no_chance_is_too_small_to_be_told():
    x, y = np.arange(16.0), np.arange(16.0) + 100
    assert rank_test(x, y) == pytest.approx(2 / math.comb(32, 16))
    assert sign_test(np.ones(30), 0) == pytest.approx(2 / 2**30)


def test_many_seeds_are_normal():
    x, y = GENERATOR.normal(0.2, 1.0, (2, 150))
    theirs = stats.mannwhitneyu(x, y, method="asymptotic", use_continuity=False).pvalue
    assert rank_test(x, y) == pytest.approx(theirs, rel=0.03)


def test_random_arrangements_stand_for_all_where_there_are_too_many(monkeypatch):
    x, y = 5 + 2 * X, 5 + 0.3 * np.append(Y, [0.1, 0.2])
    every = spread_test(x, y, 0)
    monkeypatch.setattr(hypothesis_tests, "MOST", 10_000)
    some = spread_test(x, y, 0)
    assert some == pytest.approx(every, abs=0.01)
    assert some == spread_test(x, y, 0) != spread_test(x, y, 1)


def test_random_signs_stand_for_all_where_there_are_too_many(monkeypatch):
    sample = GENERATOR.normal(0.3, 1.0, 30)
    every = sign_test(sample, 0)
    monkeypatch.setattr(hypothesis_tests, "MOST_SIGNS", 20)
    assert sign_test(sample, 0) == pytest.approx(every, abs=0.003)


def test_spread_is_relative_to_the_median():
    shape = np.array([-1.0, -0.8, -0.5, 0.1, 0.4, 0.6, 0.9, 1.2])
    small, large = 100 * (1 + 0.01 * shape), 1 + 0.5 * shape
    assert spread_test(small, large, 0) < 0.001
    assert spread_test(small, 7 * small, 0) == pytest.approx(1.0)


def test_spread_around_nothing_is_no_evidence():
    assert spread_test(np.zeros(8), np.arange(8.0), 0) == 1.0
    # Here the median of some arrangements is 0.
    mixed = np.array([-1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    assert 0 < spread_test(mixed, mixed, 0) <= 1.0


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
    found = [spread_test(draw(generator), 7 * draw(generator), 0) <= 0.05 for _ in range(400)]
    assert 0.005 <= np.mean(found) <= at_most


def test_both_sides_of_a_margin_must_hold():
    x, y = np.arange(4.0), np.arange(4.0) + 3

    def test(bound, side):
        return rank_test(x, y + bound, side)

    assert equivalence(test, -10, 10) == pytest.approx(1 / 70)  # both sides of it are as clear
    assert equivalence(test, -10, -3) == pytest.approx(rank_test(x, x, "less"))  # at the edge
    assert equivalence(test, -1, 10) > 0.9
    assert equivalence(test, 0, 1e9) == rank_test(x, y, "greater")


@pytest.mark.parametrize("scales", [(0.05, 0.09), (0.09, 0.05)])
@pytest.mark.parametrize("shape", ["normal", "laplace"])
def test_spreads_at_the_margin_are_rarely_called_equivalent(scales, shape):
    draw = getattr(np.random.default_rng(4), shape)
    pairs = [tuple(draw(1.0, scale, 16) for scale in scales) for _ in range(800)]
    edge = abs(np.mean([relative_spread(x) - relative_spread(y) for x, y in pairs]))
    found = [equivalence(partial(excess_spread_test, x, y), -edge, edge) for x, y in pairs]
    assert np.mean(np.array(found) <= 0.05) <= 0.065


def test_samples_without_spread_prove_no_equivalence():
    assert excess_spread_test(np.ones(8), np.ones(8), -0.03, "greater") == 1.0
    assert excess_spread_test(np.ones(1), X, -0.03, "greater") == 1.0
    small = 1 + 0.001 * X[:6]
    theirs = stats.ttest_ind(
        relative_deviations(X + 9) + 0.03, relative_deviations(small), equal_var=False
    )
    assert excess_spread_test(X + 9, small, -0.03, "greater") == pytest.approx(theirs.pvalue)
    assert excess_spread_test(np.ones(8), small, -0.03, "greater") < 0.001
