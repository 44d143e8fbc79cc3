"""The correction for the number of claims, differences and equivalences together."""

import numpy as np
import pytest
from scipy import stats

from jumping_ant.comparison.step_down import Adjusted, adjust

LEVEL = 0.05
NUM_CLAIMS = 12


@pytest.mark.parametrize(
    ("p_values", "adjusted"),
    [
        ([0.01, 0.04, 0.03, 0.005], [0.03, 0.06, 0.06, 0.02]),  # by hand; 0.04 stays above 0.03
        ([0.4, 0.6], [0.8, 0.8]),
        ([0.9, 0.8], [1.0, 1.0]),
        ([0.02], [0.02]),
        ([], []),
    ],
)
def test_without_margins_it_is_holms_correction(p_values, adjusted):
    found = adjust([(p, None) for p in p_values])
    assert [own.difference for own in found] == pytest.approx(adjusted)
    assert all(own.equivalence is None for own in found)


def test_a_claim_counts_until_both_of_its_hypotheses_are_rejected():
    # k is 3 for 0.001 and 0.002, whose claims have something left; 0.01 is the first one's other
    # half, and 2 claims are left after it; then 0.02 is the second one's, and 1 is left.
    found = adjust([(0.001, 0.01), (0.02, 0.002), (0.04, None)])
    assert found[0] == Adjusted(pytest.approx(0.003), pytest.approx(0.03))
    assert found[1] == Adjusted(pytest.approx(0.04), pytest.approx(0.006))
    assert found[2] == Adjusted(pytest.approx(0.04), None)


def rejected_at(level, p_values):
    """Return what Shaffer's procedure rejects, step by step as in its definition."""
    left = {(i, j): p for i, own in enumerate(p_values) for j, p in enumerate(own) if p is not None}
    rejected = set()
    while True:
        num_claims = len({claim for claim, _ in left})
        now = {key for key, p in left.items() if p <= level / num_claims}
        if not now:
            return rejected
        rejected |= now
        left = {key: p for key, p in left.items() if key not in now}


@pytest.mark.parametrize("seed", range(10))
def test_adjusted_p_values_are_the_levels_at_which_it_rejects(seed):
    generator = np.random.default_rng(seed)
    p_values = [
        (p, q if generator.random() < 0.5 else None) for p, q in generator.random((8, 2)) ** 3
    ]
    adjusted = adjust(p_values)
    for level in (0.01, 0.05, 0.2, 0.6):
        found = {(i, 0) for i, own in enumerate(adjusted) if own.difference <= level}
        found |= {(i, 1) for i, own in enumerate(adjusted) if (own.equivalence or 1.0) <= level}
        assert found == rejected_at(level, p_values)


# Effects in standard errors, of claims whose margin is 3 of them: the worst cases of the design.
@pytest.mark.parametrize(
    "effects",
    [
        np.zeros(NUM_CLAIMS),
        np.full(NUM_CLAIMS, 3.0),
        np.where(np.arange(NUM_CLAIMS) % 2, 3.0, 0.0),
        np.where(np.arange(NUM_CLAIMS) < 4, 0.0, 30.0),
    ],
    ids=["no effects", "all at the margin", "half at the margin", "most are large"],
)
def test_true_hypotheses_are_rejected_no_more_often_than_promised(effects):
    generator = np.random.default_rng(2)
    wrong = 0
    for _ in range(2000):
        found = effects + generator.standard_normal(NUM_CLAIMS)
        outside = np.maximum(stats.norm.sf(found + 3), stats.norm.cdf(found - 3))
        adjusted = adjust(list(zip(2 * stats.norm.sf(np.abs(found)), outside, strict=True)))
        wrong += any(
            (own.difference <= LEVEL and effect == 0) or (own.equivalence <= LEVEL and effect >= 3)
            for own, effect in zip(adjusted, effects, strict=True)
        )
    assert wrong / 2000 <= 0.06
