import matplotlib as mpl
import numpy as np
import pytest
from small_project import COMPARE, make_params, read_csv, write_csv, write_project

from jumping_ant.comparison import comparison
from jumping_ant.comparison.claims import verdicts
from jumping_ant.comparison.figures import claim_panels, figures, pair_matrix
from jumping_ant.comparison.results import load
from jumping_ant.looks import plotting, style

AGENTS = {"random": "random", "dqn": "dqn", "sac": "sac", "pgpe-wide": "pgpe"}
RANKED = ["pgpe-wide", "sac", "dqn", "random"]  # by the levels of small_project


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
        "final_return", "behaviour", "probability_of_improvement", "learning_curves", "efficiency",
        "claims",
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
    expected = plotting.render(drawn["final_return"], "png")
    with mpl.rc_context({"font.size": 20, "axes.facecolor": "black", "savefig.dpi": 30}):
        assert plotting.render(figures.draw(*compared)["final_return"], "png") == expected


def test_files_carry_no_date(drawn):
    svg = plotting.render(drawn["final_return"], "svg").decode()
    assert "<dc:date>" not in svg


def test_learning_curves_show_the_numbers(compared, drawn):
    curves = compared[1]
    (axes,) = drawn["learning_curves"].axes
    lines = {line.get_label(): line for line in axes.lines}
    assert list(lines) == ["random", "DQN", "SAC", "pgpe-wide"]
    np.testing.assert_allclose(lines["SAC"].get_xdata(), curves["sac"].trained)
    np.testing.assert_allclose(lines["SAC"].get_ydata(), curves["sac"].returns.value)
    assert len({line.get_color() for line in axes.lines}) == 4
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
    assert "Apex of a jump [m]" in labels
    assert all(labels)


def test_every_seed_is_a_point(compared, drawn):
    results = compared[0]
    (axes,) = drawn["final_return"].axes
    points = [line.get_xdata() for line in axes.lines if len(line.get_xdata()) == 4]
    assert len(points) == len(AGENTS)
    for own, name in zip(points, RANKED, strict=True):
        np.testing.assert_allclose(own, results[name].quantities["return"])
    assert [label.get_text() for label in axes.get_yticklabels()] == [
        "pgpe-wide", "SAC", "DQN", "random",
    ]  # fmt: skip


def test_a_row_shows_what_sums_up_its_seeds(compared, drawn):
    _, _, summary, *_ = compared
    (axes,) = drawn["final_return"].axes
    marks = {name: [] for name in ("|", "D", "o")}
    for line in axes.lines:
        if len(line.get_xdata()) == 1:
            marks[line.get_marker()].append(line.get_xdata()[0])
    entries = [summary["agents"][name]["return"] for name in RANKED]
    for marker, key in (("|", "iqm"), ("D", "mean"), ("o", "worst")):
        assert marks[marker] == [entry[key] for entry in entries]
    (legend,) = drawn["final_return"].legends
    explained = [text.get_text() for text in legend.get_texts()]
    assert explained == [
        "seed", "interquartile mean", "its interval", "mean", "worst seed",
        "value-based", "off-policy actor-critic", "evolution", "baseline",
    ]  # fmt: skip


def test_a_quantity_below_zero_has_its_axis_and_seeds_without_it_are_left_out(compared, drawn):
    panels = {axes.get_xlabel(): axes for axes in drawn["behaviour"].axes}
    assert len(panels) == 4
    fluidity = panels["Fluidity (closer to 0 is more fluid)"]
    low, high = fluidity.get_xlim()
    points = np.concatenate([line.get_xdata() for line in fluidity.lines])
    assert low < points.min() and high == 0
    assert {line.get_ydata()[0] for line in fluidity.lines} == {0, 1, 2}  # not row 3, random
    assert {line.get_ydata()[0] for line in panels["Apex of a jump [m]"].lines} == {0, 1, 2, 3}


def panel_of(compared, drawn, start):
    """The panel and the entry of the claim whose text starts so."""
    claims = compared[3]
    axes = drawn["claims"].axes
    assert len(axes) == len(claims) > 8
    (index,) = [i for i, claim in enumerate(claims) if claim["text"].startswith(start)]
    return axes[index], claims[index]


def test_a_claim_shows_its_seeds_verdict_and_corrected_p_value(compared, drawn):
    axes, claim = panel_of(compared, drawn, "SAC ends much better than DQN")
    title = " ".join(axes.get_title(loc="left").split())
    p = f"{claim['p_adjusted']:.2g}"
    assert title == f"{claim['verdict'].capitalize()}, adjusted p = {p}: {claim['text']}"
    assert [label.get_text() for label in axes.get_yticklabels()] == ["SAC", "DQN"]
    points = {line.get_ydata()[0]: line for line in axes.lines if len(line.get_xdata()) == 4}
    np.testing.assert_allclose(points[0].get_xdata(), claim["plot"]["values"]["SAC"])
    np.testing.assert_allclose(points[1].get_xdata(), claim["plot"]["values"]["DQN"])
    assert axes.get_xlabel() == "Return"


def test_an_equivalence_shows_the_p_value_that_decides_it():
    claim = {"verdict": "equivalent", "p_adjusted": 0.7, "p_equivalence_adjusted": 0.012}
    assert claim_panels.heading(claim) == "Equivalent, adjusted p = 0.012"


def test_the_same_seeds_are_joined_and_versions_drawn_as_their_agent(compared, drawn):
    axes, claim = panel_of(compared, drawn, "The centre of")
    own, rounded = claim["plot"]["values"].values()
    lines = [line for line in axes.lines if len(line.get_xdata()) == 2]
    assert [list(line.get_xdata()) for line in lines] == [
        list(p) for p in zip(own, rounded, strict=True)
    ]
    points = [line for line in axes.lines if len(line.get_xdata()) == 4]
    families = {name: agent.family for name, agent in compared[0].items()}
    look = style.looks(families)["pgpe-wide"]
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
    assert plotting.render(figure, "png").startswith(b"\x89PNG")
    assert figure.axes[0].get_xlim()[1] == 0


def test_the_matrix_shows_who_beats_whom_in_the_order_of_the_ranking(compared, drawn):
    results, _, summary, *_ = compared
    (axes,) = drawn["probability_of_improvement"].axes
    labels = [results[name].label for name in RANKED]
    assert [label.get_text() for label in axes.get_yticklabels()] == labels
    assert [label.get_text() for label in axes.get_xticklabels()] == labels
    pairs = summary["probability_of_improvement"]
    (image,) = axes.images
    shades = np.ma.filled(image.get_array(), np.nan)
    for row, one in enumerate(RANKED):
        chances = [pairs[f"{one}>{other}"]["p"] if one != other else np.nan for other in RANKED]
        np.testing.assert_array_equal(shades[row], chances)
    texts = {text.get_position(): text.get_text() for text in axes.texts}
    assert len(texts) == 12 and texts[1, 0] == "100" and texts[0, 1] == "0"


@pytest.mark.parametrize(("num_agents", "expected"), [(2, "62\n20\u2013100"), (9, "62")])
def test_cells_of_a_large_matrix_have_no_intervals(tmp_path, num_agents, expected):
    agents = {f"agent-{i}": "dqn" for i in range(num_agents)}
    write_project(tmp_path, agents, [0, 1])
    results = load(tmp_path, make_params(agents, [0, 1]))
    summary = comparison.summarize(results, COMPARE)
    chance = {"p": 0.62, "low": 0.2, "high": 1.0}
    pairs = dict.fromkeys(summary["probability_of_improvement"], chance)
    figure = pair_matrix.draw(results, summary | {"probability_of_improvement": pairs})
    assert {text.get_text() for text in figure.axes[0].texts} == {expected}


def test_costs_show_the_front_and_name_it(compared, drawn):
    results, _, summary, *_ = compared
    (axes,) = drawn["efficiency"].axes
    assert summary["pareto_steps"] == ["sac", "pgpe-wide"]
    assert [text.get_text() for text in axes.texts] == ["SAC", "pgpe-wide"]
    (front,) = [line for line in axes.lines if line.get_drawstyle() == "steps-post"]
    agents = [summary["agents"][name] for name in ("sac", "pgpe-wide", "pgpe-wide")]
    assert list(front.get_xdata()) == [agent["env_steps"] for agent in agents]
    assert list(front.get_ydata()) == [agent["return"]["iqm"] for agent in agents]
    named = {line.get_label(): line for line in axes.lines if line.get_label()[0] != "_"}
    assert set(named) == {agent.label for agent in results.values()}
    dqn = summary["agents"]["dqn"]
    assert named["DQN"].get_xdata() == [dqn["env_steps"]]
    assert named["DQN"].get_ydata() == [dqn["return"]["iqm"]]


def test_a_single_agent_and_seed_can_be_drawn(tmp_path):
    write_project(tmp_path, {"random": "random"}, [0])
    results = load(tmp_path, make_params({"random": "random"}, [0]))
    curves = comparison.learning_curves(results, COMPARE)
    drawn = figures.draw(results, curves, comparison.summarize(results, COMPARE), [], 0.9)
    assert len(figures.files(drawn)) == 6  # no pair to compare, no claim


def test_many_learners_have_a_panel_for_each_family(tmp_path):
    agents = {f"dqn-{i}": "dqn" for i in range(4)} | {f"pgpe-{i}": "pgpe" for i in range(3)}
    agents |= {"random": "random", "metronome": "open_loop"}
    write_project(tmp_path, agents, [0, 1])
    results = load(tmp_path, make_params(agents, [0, 1]))
    curves = comparison.learning_curves(results, COMPARE)
    drawn = figures.draw(results, curves, comparison.summarize(results, COMPARE), [], 0.95)
    panels = drawn["learning_curves"].axes
    assert [axes.get_title(loc="left") for axes in panels] == ["Value-based", "Evolution"]
    for axes, own in zip(panels, ["dqn", "pgpe"], strict=True):
        lines = [line.get_label() for line in axes.lines if line.get_marker() != "None"]
        assert lines == [name for name in agents if name.startswith(own)]
        thin = {
            line.get_label(): line.get_ydata()[0]
            for line in axes.lines
            if "None" in line.get_marker()
        }
        assert thin.pop("metronome") == 505  # the better baseline has its name
        assert list(thin.values()) == [335]
    assert len({axes.get_ylim() for axes in panels}) == 1
    assert len({axes.get_xlim() for axes in panels}) == 1


def test_many_claims_stand_in_more_columns(compared):
    claims = compared[3]
    few = claim_panels.draw(claims, looks_by_label(compared))
    many = claim_panels.draw([*claims, *claims, *claims], looks_by_label(compared))
    assert len(many.axes) == 3 * len(few.axes) > claim_panels.MANY
    assert many.get_figwidth() == 2 * few.get_figwidth()


def looks_by_label(compared):
    families = {agent.label: agent.family for agent in compared[0].values()}
    return style.looks(families)
