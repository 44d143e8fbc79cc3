import matplotlib as mpl
import numpy as np
import pytest
from small_project import COMPARE, make_params, write_project

from jumping_ant import comparison, figures
from jumping_ant.results import load

AGENTS = {"random": "random", "dqn": "dqn", "sac": "sac", "pgpe-wide": "pgpe"}


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    root = tmp_path_factory.mktemp("project")
    write_project(root, AGENTS, range(4))
    results = load(root, make_params(AGENTS, range(4)))
    curves = comparison.learning_curves(results, COMPARE)
    return results, curves, comparison.summarize(results, COMPARE), COMPARE.confidence


@pytest.fixture(scope="module")
def drawn(compared):
    return figures.draw(*compared)


def test_every_figure_is_there(drawn):
    assert list(drawn) == [
        "learning_curves", "final_return", "behaviour", "probability_of_improvement",
    ]  # fmt: skip


def test_files_are_pictures_and_written_twice_are_identical(compared, drawn, tmp_path):
    names = ("final_return", "probability_of_improvement")
    for folder, figs in {"first": drawn, "second": figures.draw(*compared)}.items():
        figures.write(tmp_path / folder, {name: figs[name] for name in names})
    first, second = sorted((tmp_path / "first").iterdir()), sorted((tmp_path / "second").iterdir())
    assert len(first) == 4
    for one, other in zip(first, second, strict=True):
        content = one.read_bytes()
        assert content.startswith(b"\x89PNG" if one.suffix == ".png" else b"<?xml")
        assert content == other.read_bytes()


def test_the_readers_own_settings_change_nothing(compared, drawn):
    expected = figures.render(drawn["final_return"], "png")
    with mpl.rc_context({"font.size": 20, "axes.facecolor": "black", "savefig.dpi": 30}):
        assert figures.render(figures.draw(*compared)["final_return"], "png") == expected


def test_files_carry_no_date(drawn):
    svg = figures.render(drawn["final_return"], "svg").decode()
    assert "<dc:date>" not in svg


def test_learning_curves_show_the_numbers(compared, drawn):
    _, curves, _, _ = compared
    steps, seconds = drawn["learning_curves"].axes
    lines = {line.get_label(): line for line in steps.lines}
    assert list(lines) == ["random", "DQN", "SAC", "pgpe-wide"]
    np.testing.assert_allclose(lines["SAC"].get_xdata(), curves["sac"].env_steps)
    np.testing.assert_allclose(lines["SAC"].get_ydata(), curves["sac"].returns.value)
    np.testing.assert_allclose(seconds.lines[2].get_xdata(), curves["sac"].seconds)
    assert len({line.get_color() for line in steps.lines}) == 4
    (legend,) = drawn["learning_curves"].legends
    assert [text.get_text() for text in legend.get_texts()] == list(lines)


def test_budgets_far_apart_get_a_logarithmic_axis(compared, drawn):
    results, curves, summary, confidence = compared
    assert drawn["learning_curves"].axes[0].get_xscale() == "log"  # SAC's 200 to PGPE's 8000
    fewer = {name: curves[name] for name in ("dqn", "pgpe-wide")}
    figure = figures.draw(results, fewer, summary, confidence)["learning_curves"]
    assert figure.axes[0].get_xscale() == "linear"  # 1000 to 8000


def test_axes_name_their_units(drawn):
    labels = [axes.get_xlabel() for figure in drawn.values() for axes in figure.axes]
    assert "Training budget [control steps]" in labels
    assert "Training time per seed [s]" in labels
    assert "Peak height of the torso [m]" in labels
    assert all(labels)


def test_every_seed_is_a_point(compared, drawn):
    results = compared[0]
    (axes,) = drawn["final_return"].axes
    points = [line.get_xdata() for line in axes.lines if len(line.get_xdata()) == 4]
    assert len(points) == len(AGENTS)
    for own, agent in zip(points, results.values(), strict=True):
        np.testing.assert_allclose(own, agent.quantities["return"])
    assert [label.get_text() for label in axes.get_yticklabels()] == [
        "random", "DQN", "SAC", "pgpe-wide",
    ]  # fmt: skip


def test_pairs_name_the_better_agent_first(drawn):
    (axes,) = drawn["probability_of_improvement"].axes
    names = [label.get_text() for label in axes.get_yticklabels()]
    assert names[:2] == ["DQN over random", "SAC over random"]
    assert len(names) == 6


def test_a_single_agent_and_seed_can_be_drawn(tmp_path):
    write_project(tmp_path, {"random": "random"}, [0])
    results = load(tmp_path, make_params({"random": "random"}, [0]))
    curves = comparison.learning_curves(results, COMPARE)
    drawn = figures.draw(results, curves, comparison.summarize(results, COMPARE), 0.9)
    figures.write(tmp_path / "figures", drawn)
    assert len(list((tmp_path / "figures").iterdir())) == 6  # no pair to compare


def test_many_agents_keep_apart_by_colour_and_marker(tmp_path):
    agents = {f"agent-{i}": "dqn" for i in range(12)}
    write_project(tmp_path, agents, [0])
    results = load(tmp_path, make_params(agents, [0]))
    curves = comparison.learning_curves(results, COMPARE)
    drawn = figures.draw(results, curves, comparison.summarize(results, COMPARE), 0.95)
    lines = drawn["learning_curves"].axes[0].lines
    assert len({(line.get_color(), line.get_marker()) for line in lines}) == 12
