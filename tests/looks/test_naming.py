from jumping_ant.looks.naming import Family, by_family


def test_families_stand_in_one_order_and_baselines_last() -> None:
    families: dict[str, Family] = {"random": "baseline", "b": "evolution", "a": "evolution"}
    grouped = by_family(families | {"dqn": "value-based"})
    assert grouped == {"value-based": ["dqn"], "evolution": ["b", "a"], "baseline": ["random"]}
    assert list(grouped) == ["value-based", "evolution", "baseline"]
