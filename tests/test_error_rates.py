"""The simulation of how often verdicts err, with fewer repetitions."""

import numpy as np
import pytest

from jumping_ant.comparison import hypothesis_tests
from scripts import error_rates


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hypothesis_tests, "MOST", 199)
    for name, number in (("FAMILIES", 600), ("REPEATS", 200), ("SAMPLES", 2000)):
        monkeypatch.setattr(error_rates, name, number)
    monkeypatch.setattr(error_rates, "RESAMPLES", 200)


@pytest.fixture
def normal() -> dict[str, error_rates.Draw]:
    return {"normal": error_rates.shapes(np.random.default_rng(0))["normal"]}


def test_the_rule_errs_as_rarely_as_it_says_and_holms_does_not() -> None:
    found = dict(error_rates.families())
    assert max(ours for ours, _ in found.values()) < 0.1
    assert max(holms for _, holms in found.values()) > 0.15


def test_tests_err_as_rarely_as_they_say(normal: dict[str, error_rates.Draw]) -> None:
    found = dict(error_rates.false_alarms(normal))
    assert len(found) == 9
    assert all(0 <= share < 0.12 for (share,) in found.values())
    assert found["rank test"][0] > 0.01


def test_the_margin_of_spreads_is_that_of_distributions_and_not_of_small_samples() -> None:
    """Of normal deviations the mean size is the root of 2 / pi: samples of 16 have 4 % less."""
    drawn = error_rates.shapes(np.random.default_rng(0))
    excess = (error_rates.STRETCH - 1) * np.sqrt(2 / np.pi) / error_rates.CENTRE
    assert error_rates.true_excess(drawn["normal"]) == pytest.approx(excess, rel=0.005)


def test_the_medians_of_all_shapes_but_failures_are_at_the_centre() -> None:
    drawn = error_rates.shapes(np.random.default_rng(0))
    medians = {name: np.median(draw((200_000,))) for name, draw in drawn.items()}
    assert medians.pop("a fifth of failures") == pytest.approx(-0.0956, abs=0.005)
    assert medians == pytest.approx(dict.fromkeys(medians, 0.0), abs=0.03)


def test_intervals_hold_the_truth_about_as_often_as_they_say(
    normal: dict[str, error_rates.Draw],
) -> None:
    found = dict(error_rates.coverage(normal))
    assert len(found) == 4
    assert all(0.83 < share < 0.99 for (share,) in found.values())


def test_shares_are_a_table() -> None:
    rows = iter([("one", [0.05, 0.1234])])
    assert error_rates.table(["a", "b", "c"], rows).splitlines() == [
        "| a | b | c |",
        "| --- | --- | --- |",
        "| one | 0.050 | 0.123 |",
    ]
