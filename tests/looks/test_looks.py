from jumping_ant.looks import looks
from jumping_ant.looks.naming import Family

FEW: dict[str, Family] = {
    "random": "baseline",
    "dqn": "value-based",
    "sac": "off-policy actor-critic",
    "pgpe": "evolution",
}


def test_few_learners_of_different_families_differ_in_colour_and_marker() -> None:
    found = looks.looks(FEW)
    assert found["dqn"] == looks.Look("#0072B2", "o", "-")
    assert found["sac"] == looks.Look("#D55E00", "s", "-")
    assert found["pgpe"] == looks.Look("#009E73", "^", "-")
    assert found["random"] == looks.Look("#7F7F7F", "x", "--")
    assert list(found) == list(FEW)


def test_members_of_a_family_differ_in_shade_marker_and_line() -> None:
    family: dict[str, Family] = {f"agent-{i}": "evolution" for i in range(7)}
    found = looks.looks(FEW | family)
    own = [found["pgpe"], *(found[name] for name in family)]
    assert own[1].colour == "#73CAB2"  # 45 % of the way to white: 0 + 0.45 * 255 = 115 = 0x73
    assert own[2].colour == "#005F45"  # 40 % of the way to black: 0.6 * 0x9E = 95 = 0x5F
    assert len({(look.colour, look.marker) for look in own}) == 8
    assert len({(look.colour, look.line) for look in own}) == 8
    assert len({look.colour for look in own}) == 8, "recordings have nothing but colours"
    assert found["sac"] == looks.looks(FEW)["sac"], "other families keep their looks"


def test_many_members_of_a_family_keep_apart_by_colour_and_marker() -> None:
    found = looks.looks({f"agent-{i}": "evolution" for i in range(12)})
    assert len({(look.colour, look.marker) for look in found.values()}) == 12


def test_many_baselines_keep_apart_by_grey_and_dashes() -> None:
    families: dict[str, Family] = {f"baseline-{i}": "baseline" for i in range(6)}
    found = looks.looks(families)
    assert len({(look.colour, look.line) for look in found.values()}) == 6
    assert all(look.line != "-" for look in found.values())
