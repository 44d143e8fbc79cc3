import pytest

from jumping_ant.showing import charting, panels
from jumping_ant.words.naming import Family

FEW: dict[str, Family] = {
    "random": "baseline",
    "dqn": "value-based",
    "sac": "off-policy actor-critic",
    "pgpe": "evolution",
}


@pytest.mark.parametrize("num_learners", [3, 4])
def test_many_learners_have_a_panel_for_each_family(num_learners: int) -> None:
    more: dict[str, Family] = {f"agent-{i}": "evolution" for i in range(num_learners)}
    families = FEW | more
    if num_learners == 3:  # six in all
        assert panels.panels(families) == {"": list(families)}
    else:
        assert panels.panels(families) == {
            "value-based": ["random", "dqn"],
            "off-policy actor-critic": ["random", "sac"],
            "evolution": ["random", "pgpe", *more],
        }


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([1.0, 21.0], True),
        ([1.0, 20.0], False),
        ([0.01, 0.9], False),
        ([-1.0, 99.0], False),
        ([], False),
    ],
)
def test_long_axes_are_logarithmic(values: list[float], expected: bool) -> None:
    assert charting.is_long(values) == expected
