"""How agents and numbers look."""

import pytest

from jumping_ant.agents.families import Family
from jumping_ant.media import style

FEW: dict[str, Family] = {
    "random": "baseline",
    "dqn": "value-based",
    "sac": "off-policy actor-critic",
    "pgpe": "evolution",
}


def members(family: Family, number: int) -> dict[str, Family]:
    return {f"agent-{i}": family for i in range(number)}


def test_few_learners_of_different_families_differ_in_colour_and_marker() -> None:
    assert style.looks(FEW) == {
        "random": style.Look("#7F7F7F", "x", "--"),
        "dqn": style.Look("#0072B2", "o", "-"),
        "sac": style.Look("#D55E00", "s", "-"),
        "pgpe": style.Look("#009E73", "^", "-"),
    }


def test_members_of_a_family_differ_in_shade() -> None:
    drawn = style.looks(FEW | members("evolution", 2))
    assert drawn["agent-0"].colour == "#73CAB2"  # 45 % of the way to white: 0.45 * 255 = 0x73
    assert drawn["agent-1"].colour == "#005F45"  # 40 % of the way to black: 0.6 * 0x9E = 0x5F
    assert drawn["sac"] == style.looks(FEW)["sac"], "other families keep their looks"


@pytest.mark.parametrize(
    ("family", "number", "parts"),
    [
        ("evolution", 8, ("colour",)),  # recordings have nothing else
        ("evolution", 8, ("colour", "line")),
        ("evolution", 12, ("colour", "marker")),
        ("baseline", 6, ("colour", "line")),
    ],
)
def test_many_members_keep_apart(family: Family, number: int, parts: tuple[str, ...]) -> None:
    looks = style.looks(members(family, number)).values()
    assert len({tuple(getattr(look, part) for part in parts) for look in looks}) == number


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (style.number(12345.6), "12,346"),
        (style.number(99.96), "100"),
        (style.number(1.234), "1.23"),
        (style.number(0.00123), "0.00123"),
        (style.percents(0.594, 1), "59\u2013100"),
        (style.estimate(12, 5.678, 1234, 2), "12 [5.68, 1,234]"),
        (style.estimate(12, 12, 12, 1), "12"),
    ],
)
def test_numbers_are_readable(text: str, expected: str) -> None:
    assert text == expected
