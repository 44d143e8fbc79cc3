from pathlib import Path

import pytest
from ruamel.yaml import YAML
from small_project import BUDGETS, COMPARE, make_params, write_project

from jumping_ant.agents.families import Family
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.comparison import comparison
from jumping_ant.comparison.results import load
from jumping_ant.media import style
from jumping_ant.report import charts, figures, leaderboard, outcome
from jumping_ant.report.outcome import Outcome

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
        assert style.panels(families) == {"": list(families)}
    else:
        assert style.panels(families) == {
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
    assert outcome.is_long(values) == expected


@pytest.mark.parametrize(("first", "scale"), [("dqn", "linear"), ("sac", "log")])
def test_figures_and_report_have_the_same_axes(tmp_path: Path, first: str, scale: str) -> None:
    assert (BUDGETS["pgpe"] > outcome.LONG_AXIS * BUDGETS[first]) == (scale == "log")
    agents = {first: first, "pgpe": "pgpe"}
    write_project(tmp_path, agents, [0, 1])
    params = make_params(agents, [0, 1])
    results = load(tmp_path, params)
    both = Outcome(params, results, comparison.summarize(results, COMPARE))
    (axes,) = figures.learning_curves(both).axes
    assert (axes.get_xscale(), axes.get_xlabel()) == (scale, outcome.BUDGET)
    for chart in (charts.learning(both, agents), leaderboard.cost(both)):
        axis = chart.layout.xaxis
        assert (axis.type or "linear", axis.title.text) == (scale, axes.get_xlabel())
        low, high = axis.range if scale == "linear" else [10**end for end in axis.range]
        assert low < BUDGETS[first] < BUDGETS["pgpe"] < high


def test_the_plots_of_dvc_have_the_figures_labels() -> None:
    plots = YAML(typ="safe").load(PROJECT_ROOT / "dvc.yaml")["plots"]
    curves = [plot for entry in plots for plot in entry.values()]
    assert {plot["x"]: plot["x_label"] for plot in curves} == {"env_steps": outcome.BUDGET}
    assert {plot["y_label"] for plot in curves} == {outcome.LEARNING}
