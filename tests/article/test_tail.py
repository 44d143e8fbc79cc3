"""The probability that one test of a new policy reaches a value."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from jumping_ant.article.tail import probability

Policies = Callable[[np.random.Generator, int], NDArray[np.float64]]  # chances of so many


def test_of_single_tests_it_is_jeffreys_posterior() -> None:
    found = probability([1, 0, 0, 1, 0, 0, 0, 0], 1)
    exact = stats.beta(2.5, 6.5)
    assert found.value == pytest.approx(exact.mean(), abs=1e-4)
    assert found.low == pytest.approx(exact.ppf(0.025), abs=3e-3)
    assert found.high == pytest.approx(exact.ppf(0.975), abs=3e-3)


def test_policies_that_differ_count_as_policies_and_not_as_tests() -> None:
    alike, different = probability([5] * 8, 50), probability([0] * 7 + [40], 50)
    assert alike.value == pytest.approx(0.1, abs=0.02)
    assert different.high - different.low > 2 * (alike.high - alike.low)


def test_more_policies_that_reach_nothing_make_it_rarer() -> None:
    values = [probability([0] * count, 50).value for count in (1, 4, 16, 64)]
    assert values == sorted(values, reverse=True)
    assert values[0] > 0.05 and values[-1] < 0.005


def mixture(chances: list[float], shares: list[float]) -> Policies:
    return lambda generator, count: generator.choice(chances, count, p=shares)


def coverage(policies: Policies, truth: float, count: int, num_samples: int = 400) -> float:
    """Return the share of samples of policies whose interval covers the truth."""
    generator, covered = np.random.default_rng(0), 0
    for _ in range(num_samples):
        reached = generator.binomial(50, policies(generator, count)).tolist()
        found = probability(reached, 50)
        covered += found.low <= truth <= found.high
    return covered / num_samples


@pytest.mark.parametrize("count", [8, 16, 40])
@pytest.mark.parametrize(
    ("policies", "truth"),
    [
        (mixture([0.0, 0.2, 0.55], [0.75, 0.125, 0.125]), 0.09375),  # as it was found in a run
        (mixture([0.15], [1.0]), 0.15),
        (mixture([0.02, 0.98], [0.5, 0.5]), 0.5),
        (lambda generator, count: generator.beta(0.22, 2.1, count), 0.22 / 2.32),
    ],
)
def test_its_interval_covers(policies: Policies, truth: float, count: int) -> None:
    """In at least 95 % of samples, whatever the policies are, less three standard errors."""
    assert coverage(policies, truth, count) >= 0.95 - 3 * np.sqrt(0.95 * 0.05 / 400)


def test_its_interval_is_too_narrow_if_few_policies_reach_the_value_always() -> None:
    """docs/article.md says so."""
    assert 0.7 < coverage(mixture([0.0, 1.0], [0.9, 0.1]), 0.1, 16) < 0.9
