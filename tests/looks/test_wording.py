"""Numbers in words."""

import pytest

from jumping_ant.looks import wording


@pytest.mark.parametrize(
    ("value", "text"),
    [(12345.6, "12,346"), (100, "100"), (99.96, "100"), (1.234, "1.23"), (0.00123, "0.00123")],
)
def test_number(value: float, text: str) -> None:
    assert wording.number(value) == text


def test_shares_are_in_per_cent() -> None:
    assert wording.percent(0.826) == "83"
    assert wording.percents(0.594, 1) == "59\u2013100"


def test_an_estimate_has_its_interval_but_for_one_seed() -> None:
    assert wording.estimate(12, 5.678, 1234, 2) == "12 [5.68, 1,234]"
    assert wording.estimate(1, 1, 1, 4) == "1 [1, 1]"
    assert wording.estimate(12, 12, 12, 1) == "12"
    assert wording.interval(12, 12, 1) == ""
