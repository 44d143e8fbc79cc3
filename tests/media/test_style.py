"""How agents and numbers look."""

import pytest

from jumping_ant.agents.families import Family, by_family
from jumping_ant.media import style

FEW: dict[str, Family] = {
    "random": "baseline",
    "dqn": "value-based",
    "sac": "off-policy actor-critic",
    "pgpe": "evolution",
}


def members(family: Family, number: int) -> dict[str, Family]:
    return {f"agent-{i}": family for i in range(number)}


def test_families_stand_in_one_order_and_baselines_last() -> None:
    grouped = by_family(FEW | members("evolution", 2))
    assert list(grouped) == ["value-based", "off-policy actor-critic", "evolution", "baseline"]
    assert grouped["evolution"] == ["pgpe", "agent-0", "agent-1"]


def test_few_learners_of_different_families_differ_in_colour_and_marker() -> None:
    looks = style.looks(FEW)
    assert looks == {
        "random": style.Look("#7F7F7F", "x", "--"),
        "dqn": style.Look("#0072B2", "o", "-"),
        "sac": style.Look("#D55E00", "s", "-"),
        "pgpe": style.Look("#009E73", "^", "-"),
    }
    assert list(looks) == list(FEW)


def test_members_of_a_family_differ_in_shade_marker_and_line() -> None:
    family = members("evolution", 7)
    drawn = style.looks(FEW | family)
    looks = [drawn["pgpe"], *(drawn[name] for name in family)]
    assert looks[1].colour == "#73CAB2"  # 45 % of the way to white: 0 + 0.45 * 255 = 115 = 0x73
    assert looks[2].colour == "#005F45"  # 40 % of the way to black: 0.6 * 0x9E = 95 = 0x5F
    assert len({look.colour for look in looks}) == 8, "recordings have nothing but colours"
    assert drawn["sac"] == style.looks(FEW)["sac"], "other families keep their looks"


@pytest.mark.parametrize(
    ("family", "number", "parts"),
    [
        ("evolution", 8, ("colour", "line")),
        ("evolution", 12, ("colour", "marker")),
        ("baseline", 6, ("colour", "line")),
    ],
)
def test_many_members_keep_apart(family: Family, number: int, parts: tuple[str, str]) -> None:
    looks = style.looks(members(family, number)).values()
    assert len({tuple(getattr(look, part) for part in parts) for look in looks}) == number
    assert all(look.line != "-" for look in looks) or family != "baseline"


@pytest.mark.parametrize(
    ("value", "text"),
    [(12345.6, "12,346"), (100, "100"), (99.96, "100"), (1.234, "1.23"), (0.00123, "0.00123")],
)
def test_numbers_are_readable(value: float, text: str) -> None:
    assert style.number(value) == text


def test_shares_are_in_per_cent() -> None:
    assert style.percents(0.594, 1) == "59\u2013100"


def test_an_estimate_has_its_interval_but_for_one_seed() -> None:
    assert style.estimate(12, 5.678, 1234, 2) == "12 [5.68, 1,234]"
    assert style.estimate(12, 12, 12, 1) == "12"
