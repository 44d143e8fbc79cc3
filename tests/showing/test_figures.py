import matplotlib as mpl
import numpy as np
import pytest
from small_project import COMPARE, make_params, read_csv, write_csv, write_project

from jumping_ant.judging import comparison
from jumping_ant.judging.claims import verdicts
from jumping_ant.judging.results import load
from jumping_ant.showing import figures
from jumping_ant.words import looks

AGENTS = {"random": "random", "dqn": "dqn", "sac": "sac", "pgpe-wide": "pgpe"}


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    root = tmp_path_factory.mktemp("project")
    write_project(root, AGENTS, range(4))
    (folder,) = root.glob("results/agents/random")
    without_fluidity(folder / "episodes.csv")
    results = load(root, make_params(AGENTS, range(4)))
    curves = comparison.learning_curves(results, COMPARE)
    claims = verdicts.check(results, COMPARE, evaluation_episodes=2)
    return results, curves, comparison.summarize(results, COMPARE), claims, COMPARE.confidence


def without_fluidity(path):
    rows = read_csv(path)
    write_csv(path, [row | {"fluidity": ""} for row in rows])


@pytest.fixture(scope="module")
def drawn(compared):
    return figures.draw(*compared)


def test_every_figure_is_there(drawn):
    assert list(drawn) == [
        "learning_curves", "final_return", "behaviour", "probability_of_improvement", "claims",
    ]  # fmt: skip


def test_files_are_pictures_and_drawn_twice_are_identical(compared, drawn):
    names = ("final_return", "claims")
    first, second = (
        figures.files({name: figs[name] for name in names})
        for figs in (drawn, figures.draw(*compared))
    )
    assert len(first) == 4
    for name, content in first.items():
        assert content.startswith(b"\x89PNG" if name.endswith(".png") else b"<?xml")
    assert first == second


def test_the_readers_own_settings_change_nothing(compared, drawn):
    expected = figures.render(drawn["final_return"], "png")
    with mpl.rc_context({"font.size": 20, "axes.facecolor": "black", "savefig.dpi": 30}):
        assert figures.render(figures.draw(*compared)["final_return"], "png") == expected


def test_files_carry_no_date(drawn):
    svg = figures.render(drawn["final_return"], "svg").decode()
    assert "<dc:date>" not in svg


def test_learning_curves_show_the_numbers(compared, drawn):
    curves = compared[1]
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
    results, curves, *others = compared
    assert drawn["learning_curves"].axes[0].get_xscale() == "log"  # SAC's 200 to PGPE's 8000
    fewer = {name: curves[name] for name in ("dqn", "pgpe-wide")}
    figure = figures.draw(results, fewer, *others)["learning_curves"]
    assert figure.axes[0].get_xscale() == "linear"  # 1000 to 8000


def test_axes_name_their_units(drawn):
    labels = [axes.get_xlabel() for figure in drawn.values() for axes in figure.axes]
    assert "Training budget [control steps]" in labels
    assert "Training time per seed [s]" in labels
    assert "Apex of a jump [m]" in labels
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


def test_a_row_shows_what_sums_up_its_seeds(compared, drawn):
    results, _, summary, *_ = compared
    (axes,) = drawn["final_return"].axes
    marks = {name: [] for name in ("|", "D", "o")}
    for line in axes.lines:
        if len(line.get_xdata()) == 1:
            marks[line.get_marker()].append(line.get_xdata()[0])
    entries = [summary["agents"][name]["return"] for name in results]
    for marker, key in (("|", "iqm"), ("D", "mean"), ("o", "worst")):
        assert marks[marker] == [entry[key] for entry in entries]
    (legend,) = drawn["final_return"].legends
    explained = [text.get_text() for text in legend.get_texts()]
    assert explained == ["seed", "interquartile mean", "its interval", "mean", "worst seed"]


def test_a_quantity_below_zero_has_its_axis_and_seeds_without_it_are_left_out(compared, drawn):
    panels = {axes.get_xlabel(): axes for axes in drawn["behaviour"].axes}
    assert len(panels) == 4
    fluidity = panels["Fluidity (closer to 0 is more fluid)"]
    low, high = fluidity.get_xlim()
    points = np.concatenate([line.get_xdata() for line in fluidity.lines])
    assert low < points.min() and high == 0
    assert {line.get_ydata()[0] for line in fluidity.lines} == {1, 2, 3}  # not row 0, random
    assert {line.get_ydata()[0] for line in panels["Apex of a jump [m]"].lines} == {0, 1, 2, 3}


def panel_of(compared, drawn, start):
    """The panel and the entry of the claim whose text starts so."""
    claims = compared[3]
    axes = drawn["claims"].axes
    assert len(axes) == len(claims) > 10
    (index,) = [i for i, claim in enumerate(claims) if claim["text"].startswith(start)]
    return axes[index], claims[index]


def test_a_claim_shows_its_seeds_verdict_and_corrected_p_value(compared, drawn):
    axes, claim = panel_of(compared, drawn, "SAC ends much better than DQN")
    title = " ".join(axes.get_title(loc="left").split())
    p = f"{claim['p_holm']:.2g}"
    assert title == f"{claim['verdict'].capitalize()}, p = {p} after Holm: {claim['text']}"
    assert [label.get_text() for label in axes.get_yticklabels()] == ["SAC", "DQN"]
    points = {line.get_ydata()[0]: line for line in axes.lines if len(line.get_xdata()) == 4}
    np.testing.assert_allclose(points[0].get_xdata(), claim["plot"]["values"]["SAC"])
    np.testing.assert_allclose(points[1].get_xdata(), claim["plot"]["values"]["DQN"])
    assert axes.get_xlabel() == "Return"


def test_the_same_seeds_are_joined_and_versions_drawn_as_their_agent(compared, drawn):
    axes, claim = panel_of(compared, drawn, "Discrete actions are inefficient: SAC")
    own, rounded = claim["plot"]["values"].values()
    lines = [line for line in axes.lines if len(line.get_xdata()) == 2]
    assert [list(line.get_xdata()) for line in lines] == [
        list(p) for p in zip(own, rounded, strict=True)
    ]
    points = [line for line in axes.lines if len(line.get_xdata()) == 4]
    look = looks.looks({name: name == "random" for name in AGENTS})["sac"]
    assert {(line.get_color(), line.get_marker()) for line in points} == {
        (look.colour, look.marker)
    }


def test_seeds_that_never_got_there_are_hollow(compared):
    results, curves, summary, claims, confidence = compared
    (claim,) = [c for c in claims if "more control steps than SAC" in c["text"]]
    label = "SAC"
    changed = claim["plot"] | {
        "reached": {label: [True, False, True, False], "pgpe-wide": [True] * 4}
    }
    figure = figures.draw(results, curves, summary, [claim | {"plot": changed}], confidence)
    (axes,) = figure["claims"].axes
    steps = claim["plot"]["values"][label]
    row = list(claim["plot"]["values"]).index(label)
    found = {
        line.get_markerfacecolor(): list(line.get_xdata())
        for line in axes.lines
        if len(line.get_ydata()) and line.get_ydata()[0] == row
    }
    assert found["none"] == [steps[1], steps[3]]
    (filled,) = found.keys() - {"none"}
    assert found[filled] == [steps[0], steps[2]]


def test_values_that_are_not_there_are_left_out(compared):
    results, curves, summary, claims, confidence = compared
    (claim,) = [c for c in claims if c["text"].startswith("DQN moves less fluidly")]
    values = claim["plot"]["values"] | {"DQN": [None] * 4}
    empty = claim | {"plot": claim["plot"] | {"values": values}}
    figure = figures.draw(results, curves, summary, [empty], confidence)["claims"]
    assert figures.render(figure, "png").startswith(b"\x89PNG")
    assert figure.axes[0].get_xlim()[1] == 0


def test_pairs_name_the_better_agent_first(drawn):
    (axes,) = drawn["probability_of_improvement"].axes
    names = [label.get_text() for label in axes.get_yticklabels()]
    assert names[:2] == ["DQN over random", "SAC over random"]
    assert len(names) == 6


def test_a_single_agent_and_seed_can_be_drawn(tmp_path):
    write_project(tmp_path, {"random": "random"}, [0])
    results = load(tmp_path, make_params({"random": "random"}, [0]))
    curves = comparison.learning_curves(results, COMPARE)
    drawn = figures.draw(results, curves, comparison.summarize(results, COMPARE), [], 0.9)
    assert len(figures.files(drawn)) == 6  # no pair to compare, no claim


def test_many_agents_keep_apart_by_colour_and_marker(tmp_path):
    agents = {f"agent-{i}": "dqn" for i in range(12)}
    write_project(tmp_path, agents, [0])
    results = load(tmp_path, make_params(agents, [0]))
    curves = comparison.learning_curves(results, COMPARE)
    drawn = figures.draw(results, curves, comparison.summarize(results, COMPARE), [], 0.95)
    lines = drawn["learning_curves"].axes[0].lines
    assert len({(line.get_color(), line.get_marker()) for line in lines}) == 12


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([1.0, 31.0], True),
        ([1.0, 30.0], False),
        ([0.01, 0.9], False),
        ([-1.0, 99.0], False),
        ([], False),
    ],
)
def test_long_axes_are_logarithmic(values, expected):
    assert looks.is_long(values) == expected


def test_many_baselines_keep_apart_by_grey_and_dashes():
    found = looks.looks({f"baseline-{i}": True for i in range(6)} | {"sac": False})
    assert found.pop("sac").line == "-"
    assert len({(look.colour, look.line) for look in found.values()}) == 6
    assert all(look.line != "-" for look in found.values())
