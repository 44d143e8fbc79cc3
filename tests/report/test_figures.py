import matplotlib as mpl
import numpy as np
import pytest
from ruamel.yaml import YAML
from small_project import BUDGETS, COMPARE, make_params, write_project

from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.comparison import comparison
from jumping_ant.comparison.results import load
from jumping_ant.report import charts, figures, leaderboard, outcome
from jumping_ant.report.outcome import Outcome

AGENTS = {"random": "random", "dqn": "dqn", "sac": "sac", "pgpe-wide": "pgpe"}
RANKED = ["pgpe-wide", "sac", "dqn", "random"]  # by the levels of small_project


def compare(root, agents, seeds):
    """Write a project, and return its outcome."""
    write_project(root, agents, seeds)
    params = make_params(agents, seeds)
    results = load(root, params)
    return Outcome(params, results, comparison.summarize(results, COMPARE))


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    return compare(tmp_path_factory.mktemp("project"), AGENTS, range(4))


def test_files_are_the_same_whatever_the_readers_settings(compared):
    files = figures.draw(compared)
    assert list(files) == [
        "learning_curves.png", "learning_curves.svg", "final_return.png", "final_return.svg",
    ]  # fmt: skip
    for name, content in files.items():
        assert content.startswith(b"\x89PNG" if name.endswith(".png") else b"<?xml")
        assert b"<dc:date>" not in content
    with mpl.rc_context({"font.size": 20, "axes.facecolor": "black", "savefig.dpi": 30}):
        assert figures.draw(compared) == files


def test_learning_curves_show_the_numbers(compared):
    curves = compared.curves
    figure = figures.learning_curves(compared)
    (axes,) = figure.axes
    lines = {line.get_label(): line for line in axes.lines}
    assert list(lines) == ["random", "DQN", "SAC", "pgpe-wide"]
    np.testing.assert_allclose(lines["SAC"].get_xdata(), curves["sac"].trained)
    np.testing.assert_allclose(lines["SAC"].get_ydata(), curves["sac"].returns.value)
    assert len({line.get_color() for line in axes.lines}) == 4
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == list(lines)


def test_a_row_shows_its_seeds_and_what_sums_them_up(compared):
    results, agents = compared.results, compared.agents
    figure = figures.final_return(compared)
    (axes,) = figure.axes
    assert [label.get_text() for label in axes.get_yticklabels()] == [
        "pgpe-wide", "SAC", "DQN", "random",
    ]  # fmt: skip
    points = [line.get_xdata() for line in axes.lines if len(line.get_xdata()) == 4]
    np.testing.assert_allclose(points, [results[name].quantities["return"] for name in RANKED])
    marks = {name: [] for name in ("|", "D", "o")}
    for line in axes.lines:
        if len(line.get_xdata()) == 1:
            marks[line.get_marker()].append(line.get_xdata()[0])
    for marker, key in (("|", "iqm"), ("D", "mean"), ("o", "worst")):
        assert marks[marker] == [agents[name]["return"][key] for name in RANKED]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "seed", "interquartile mean", "its interval", "mean", "worst seed",
        "value-based", "off-policy actor-critic", "evolution", "baseline",
    ]  # fmt: skip


def test_a_single_agent_and_seed_can_be_drawn(tmp_path):
    assert len(figures.draw(compare(tmp_path, {"random": "random"}, [0]))) == 4


def test_many_learners_have_a_panel_for_each_family(tmp_path):
    agents = {f"dqn-{i}": "dqn" for i in range(4)} | {f"pgpe-{i}": "pgpe" for i in range(3)}
    agents |= {"random": "random", "metronome": "open_loop"}
    panels = figures.learning_curves(compare(tmp_path, agents, [0, 1])).axes
    assert [axes.get_title() for axes in panels] == ["Value-based", "Evolution"]
    for axes, family in zip(panels, ["dqn", "pgpe"], strict=True):
        learned = [line for line in axes.lines if line.get_marker() != "None"]
        assert [line.get_label() for line in learned] == [
            name for name in agents if name.startswith(family)
        ]
        levels = [line for line in axes.lines if line not in learned]
        thin = {line.get_label(): line.get_ydata()[0] for line in levels}
        assert thin.pop("metronome") == 505  # the better baseline has its name
        assert list(thin.values()) == [335]
    assert len({(axes.get_xlim(), axes.get_ylim()) for axes in panels}) == 1


@pytest.mark.parametrize(
    ("values", "expected"),
    [([1.0, 21.0], True), ([1.0, 20.0], False), ([0.01, 0.9], False), ([], False)],
)
def test_long_axes_are_logarithmic(values, expected):
    assert outcome.is_long(values) == expected


@pytest.mark.parametrize(("first", "scale"), [("dqn", "linear"), ("sac", "log")])
def test_figures_and_report_have_the_same_axes(tmp_path, first, scale):
    assert (BUDGETS["pgpe"] > outcome.LONG_AXIS * BUDGETS[first]) == (scale == "log")
    both = compare(tmp_path, {first: first, "pgpe": "pgpe"}, [0, 1])
    (axes,) = figures.learning_curves(both).axes
    assert (axes.get_xscale(), axes.get_xlabel()) == (scale, outcome.BUDGET)
    axis = charts.learning(both, both.results).layout.xaxis
    assert (axis.type or "linear", axis.title.text) == (scale, axes.get_xlabel())
    low, high = axis.range if scale == "linear" else [10**end for end in axis.range]
    assert low < BUDGETS[first] < BUDGETS["pgpe"] < high
    axis = leaderboard.cost(both).layout.xaxis  # validation outweighs these budgets
    assert (axis.type or "linear", axis.title.text) == ("linear", leaderboard.COST)


def test_the_plots_of_dvc_have_the_figures_labels():
    plots = YAML(typ="safe").load(PROJECT_ROOT / "dvc.yaml")["plots"]
    curves = [plot for entry in plots for plot in entry.values()]
    assert {plot["x"]: plot["x_label"] for plot in curves} == {"env_steps": outcome.BUDGET}
    assert {plot["y_label"] for plot in curves} == {outcome.LEARNING}
