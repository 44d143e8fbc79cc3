import re
import shutil
from collections.abc import Callable
from html import escape
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pytest
from reported import AGENTS, SEEDS, charts, write_summaries
from small_project import make_params, shown, write_project

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import digest, read_json, write_bytes
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import comparison
from jumping_ant.comparison.results import AgentResults, load
from jumping_ant.params import presets
from jumping_ant.params.model import Params
from jumping_ant.report import head_to_head, page
from jumping_ant.report.outcome import Outcome
from jumping_ant.sim import trajectory
from jumping_ant.tracking import models, pages, store

Summary = dict[str, Any]
RANKED = {"pgpe": "PGPE", "sac": "SAC", "dqn": "DQN", "random": "random"}  # labels by name


class Reader(HTMLParser):
    """Collects the links of a page, and the text of its table cells and headings."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[tuple[str, str]] = []
        self.cells: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.links += [(tag, value or "") for name, value in attributes if name in ("src", "href")]
        if tag in ("td", "th", "tr", "h3"):
            self.cells.append("")

    def handle_data(self, data: str) -> None:
        if self.cells:
            self.cells[-1] += " ".join(data.split())


def test_every_link_stays_on_this_machine(html: str, project: Path) -> None:
    links = Reader(html).links
    files = [link for _, link in links if link.startswith("../")]
    assert {f"../media/{name}.mp4" for name in AGENTS} <= set(files)
    for tag, link in links:
        assert link.startswith(("../", "#", "data:", "play.html", page.MLFLOW)), link
        assert tag in ("a", "iframe", "video", "img", "link")
    for link in files:
        if not link.endswith(".rrd"):  # recordings take longer than this test may
            assert (project / "results" / link).resolve().is_file(), link


def test_links_lead_to_what_tracking_writes(html: str, project: Path) -> None:
    expected = {f"{page.MLFLOW}/#/models/{models.registered_name(name)}" for name in AGENTS}
    for policy in project.glob("models/*/*/policy.zip"):
        sha256 = digest(policy)
        assert f'title="{sha256}"' in html
        condition = f"tags.{store.POLICY_DIGEST} = '{sha256}'"
        expected.add(f"{page.RUNS}&searchFilter={condition}")
    links = {unquote(link) for _, link in Reader(html).links if link.startswith(page.MLFLOW)}
    assert links == expected
    assert len(expected) == len(AGENTS) * (1 + len(SEEDS))
    assert f"{page.MLFLOW}/{pages.address('1')}".startswith(page.RUNS)


def test_the_tables_show_the_comparison(html: str, summary: Summary) -> None:
    cells, agents = Reader(html).cells, summary["agents"]
    dqn, early = agents["dqn"]["return"], agents["sac"]["return_at_equal_steps"]
    for entry in (dqn, early):
        assert f"{entry['iqm']:,.0f}[{entry['low']:,.0f}, {entry['high']:,.0f}]" in cells
    assert {f"{dqn['mean']:.0f}", f"{dqn['worst']:.0f}"} <= set(cells)
    best = re.findall(r'"best">(\S+)', html)
    assert len(best) == 3 + 3, "of return, apex and fluidity one, of flight a tie, and no cost"
    assert f"{agents['pgpe']['return']['iqm']:,.0f}" in best
    rows = re.findall(r"<tr>(.*?)</tr>", html, re.S)
    (sac,) = [row for row in rows if ">SAC" in row and "3,015" in row]  # the mean of four seeds
    assert ">3,008\n" in sac, "the final policy: 7 less, as the variants of small_project"
    (random,) = [row for row in rows if ">random" in row and "<td>345" in row]
    assert random.count("<td>–") == 1, "no budget"
    assert " ".join(html.split()).count("random <small>baseline</small>") == 2, "in both tables"


def test_every_claim_stands_with_its_verdict(html: str, summary: Summary) -> None:
    claims, left_out = summary["claims"], summary["not_asked"]
    assert len(claims) > 8
    text = " ".join(Reader(html).cells)
    for claim in claims:
        assert f"{claim['verdict']}{claim['text']}" in text
        assert escape(claim["evidence"]) in html
    assert all(escape(f"{it['text']} ({it['reason']})") in html for it in left_out)
    assert "no agent metronome in this run" in html


def test_claims_are_grouped_by_statement_and_counted() -> None:
    tested = [("A", "refuted"), (None, "supported"), ("B", "refuted"), ("A", "supported")]
    entries = [{"statement": title, "verdict": verdict} for title, verdict in tested]
    read = head_to_head.statements(entries)
    assert [(statement["title"], statement["counts"]) for statement in read] == [
        ("A", {"supported": 1, "refuted": 1}),
        (head_to_head.OWN, {"supported": 1}),
        ("B", {"refuted": 1}),
    ]
    assert [claim["index"] for one in read for claim in one["claims"]] == [0, 3, 1, 2]


def test_a_claims_chart_shows_every_seed(html: str, summary: Summary) -> None:
    drawn = charts(html)
    for index, claim in enumerate(summary["claims"]):
        plot, chart = claim["plot"], drawn[f"claim_{index}"]
        points = [trace for trace in chart["data"] if trace["mode"] == "markers"]
        assert {trace["y"][0]: trace["x"] for trace in points} == plot["values"]
        lines = [trace for trace in chart["data"] if trace["mode"] == "lines"]
        assert len(lines) == ("paired" in plot)
        if lines:  # between the values of each seed
            assert lines[0]["x"][:2] == [trace["x"][0] for trace in points]
        assert chart["layout"]["xaxis"]["title"]["text"] == plot["axis"]


def test_seeds_that_never_got_there_are_hollow_and_versions_look_like_their_agent() -> None:
    plot = {
        "axis": "Steps",
        "values": {"SAC": [1.0, 2.0], "SAC, rounded": [3.0, None]},
        "reached": {"SAC": [True, False]},
    }
    params = make_params({"sac": "sac"}, [5, 6])
    results = {"sac": AgentResults("sac", params.agents["sac"], quantities={}, curves={})}
    sac, rounded = head_to_head.claim(Outcome(params, results, summary={}), plot).data
    assert sac.marker.symbol == ("circle", "circle-open")
    assert sac.text == ("seed 5", "seed 6, which never got there")
    assert rounded.marker.symbol == ("circle", "circle")
    assert rounded.x == (3.0, None)
    assert sac.marker.color == rounded.marker.color


def test_charts_show_the_data(html: str, project: Path, settings: Params) -> None:
    drawn = charts(html)
    curves = comparison.learning_curves(load(project, settings), settings.compare)
    lines = {trace["name"]: trace for trace in drawn["learning_0"]["data"] if "name" in trace}
    assert lines["SAC"]["y"] == curves["sac"].returns.value.tolist()
    assert lines["SAC"]["x"] == curves["sac"].trained.tolist()
    boxes = [box for box in drawn["episodes"]["data"] if box["visible"]]
    assert [len(box["x"]) for box in boxes] == [len(SEEDS) * 3] * len(AGENTS)
    heights = {trace["name"]: trace["y"] for trace in drawn["heights"]["data"]}
    assert len(heights["PGPE"]) == 101, "as long as the film: one second, a hundred steps"
    assert max(heights["PGPE"]) > max(heights["DQN"]), "it was thrown up faster"
    for name in AGENTS:
        (torques,) = drawn[f"torques_{name}"]["data"]
        assert np.shape(torques["z"]) == (8, 20)


def test_the_ranking_shows_each_agents_interval(html: str, summary: Summary) -> None:
    chart = charts(html)["ranking"]
    points = [trace for trace in chart["data"] if "error_x" in trace]
    assert chart["layout"]["yaxis"]["categoryarray"] == [*RANKED.values()]
    for trace, (name, label) in zip(points, RANKED.items(), strict=True):
        entry = summary["agents"][name]["return"]
        assert (trace["x"], trace["y"]) == ([entry["iqm"]], [label])
        assert trace["error_x"]["array"] == [entry["high"] - entry["iqm"]]
        assert trace["error_x"]["arrayminus"] == [entry["iqm"] - entry["low"]]
    colours = {trace["name"]: trace["marker"]["color"] for trace in chart["data"][8:]}
    assert list(colours) == ["value-based", "off-policy actor-critic", "evolution", "baseline"]
    assert colours["evolution"] == points[0]["marker"]["color"]


def test_costs_have_their_front_and_baselines(html: str, summary: Summary) -> None:
    agents, chart = summary["agents"], charts(html)["cost"]
    assert summary["pareto_steps"] == ["sac", "pgpe"]
    line, *points = [trace for trace in chart["data"] if trace["x"] != [None]]
    assert line["x"] == [agents[name]["cost_steps"] for name in ("sac", "pgpe", "pgpe")]
    assert line["y"] == [agents[name]["return"]["iqm"] for name in ("sac", "pgpe", "pgpe")]
    assert {trace["text"][0]: trace["y"] for trace in points} == {
        RANKED[name]: [agents[name]["return"]["iqm"]] for name in ("dqn", "sac", "pgpe")
    }
    (baseline,) = chart["layout"]["shapes"]
    assert baseline["y0"] == baseline["y1"] == agents["random"]["return"]["iqm"]
    assert (baseline["name"], baseline["showlegend"]) == ("random", True)


def test_the_matrix_shows_who_beats_whom(html: str, summary: Summary) -> None:
    pairs = summary["probability_of_improvement"]
    (cells,) = charts(html)["improvement"]["data"]
    assert cells["x"] == cells["y"] == [*RANKED.values()]
    assert cells["z"] == [
        [pairs[f"{one}>{other}"]["p"] if one != other else None for other in RANKED]
        for one in RANKED
    ]
    assert cells["text"][0] == cells["customdata"][0] == ["", "100", "100", "100"]


def test_what_agents_withstand_is_shown_with_its_levels(html: str, project: Path) -> None:
    summary = read_json(Paths(project).robustness, "")
    drawn = charts(html)
    (table,) = drawn["withstood"]["data"]
    assert table["y"] == ["DQN", "SAC", "PGPE"], "by family, without random actions"
    assert [name.lower().replace(" ", "_") for name in table["x"]] == summary["perturbations"]
    for label, row, texts in zip(table["y"], table["z"], table["text"], strict=True):
        kept = summary["agents"][label.lower()]
        assert row == [kept[name]["retention"][-1] for name in summary["perturbations"]]
        assert texts == [f"{100 * share:.0f}" for share in row]
    lines = drawn["levels"]["data"]
    assert len(lines) == 3 * len(summary["perturbations"])
    assert [line["visible"] for line in lines] == [True] * 3 + [False] * (len(lines) - 3)
    assert lines[0]["x"] == ["0.5", "0.8", "1.7", "3"]
    titles = [
        button["args"][1]["xaxis.title.text"]
        for button in drawn["levels"]["layout"]["updatemenus"][0]["buttons"]
    ]
    assert titles[0] == "Mass of the torso [kg]"
    assert "Age of observations [control steps]" in titles


def test_title_and_heading_name_those_that_learn_the_robot_and_its_aim(html: str) -> None:
    assert "<title>Ant: DQN, SAC and PGPE compared</title>" in html
    assert "<h1>Who teaches the Ant to jump?</h1>" in html
    run, hopper = presets.load("run"), presets.load("hopper")
    assert (page._robot_name(run), page._aim(run)) == ("Ant", "run")
    assert (page._robot_name(hopper), page._aim(hopper)) == ("Hopper", "jump")


@pytest.mark.parametrize(("name", "outcome"), [("random", "330"), ("sac", "3,000")])
def test_a_lone_agent_of_one_seed_has_a_page(
    project: Path, settings: Params, tmp_path: Path, name: str, outcome: str
) -> None:
    shutil.copytree(project, tmp_path, dirs_exist_ok=True)
    write_project(tmp_path, {name: AGENTS[name]}, SEEDS[:1])
    path = Paths(tmp_path).agent(name).trajectory
    write_bytes(path, shown(tmp_path, name, trajectory.load(path)).to_bytes())
    agents = {name: settings.agents[name]}
    alone = settings.model_copy(update={"agents": agents, "seeds": SEEDS[:1]})
    write_summaries(tmp_path, alone, lambda seed: 0.9)
    text = page.build(tmp_path, alone)
    drawn, label = charts(text), RANKED[name]
    assert f"<title>Ant: {label}</title>" in text
    assert f"{label} returns {outcome}.</p>" in text
    assert "1 training seed," in text and "in brackets" not in text
    assert {one in drawn for one in ("learning_0", "withstood")} == {name == "sac"}
    places = set(re.findall(r'<(?:div|section)[^>]* id="([\w-]+)"', text))
    links = {link[1:] for _, link in Reader(text).links if link.startswith("#")}
    assert drawn.keys() | links <= places
    assert not places & {"claims", "improvement"}


@pytest.fixture(scope="module")
def crowd(project: Path, settings: Params, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The page of seven learners, five of them SAC."""
    root = tmp_path_factory.mktemp("crowd")
    shutil.copytree(project, root, dirs_exist_ok=True)
    agents = AGENTS | {f"sac-{i}": "sac" for i in range(4)}
    for name in agents.keys() - AGENTS.keys():
        shutil.copytree(project / "models" / "sac", root / "models" / name)
        shutil.copyfile(project / "media" / "sac.mp4", root / "media" / f"{name}.mp4")
    write_project(root, agents, SEEDS)
    for name, algorithm in agents.items():
        episode = trajectory.load(Paths(project).agent(algorithm).trajectory)
        path = Paths(root).agent(name).trajectory
        write_bytes(path, shown(root, name, episode).to_bytes())
    blocks = {name: settings.agents[algorithm] for name, algorithm in agents.items()}
    many = settings.model_copy(update={"agents": blocks})
    write_summaries(root, many, lambda seed: 0.9)
    return page.build(root, many)


def test_many_learners_are_grouped_by_family(crowd: str) -> None:
    names = ["Value-based", "Off-policy actor-critic", "Evolution", "Baseline"]
    assert re.findall(r'<tr class="family"><th[^>]*>([^<]*)</th>', crowd) == 2 * names
    films = crowd[crowd.index('id="films"') : crowd.index('class="player"')]
    assert re.findall(r"<h3>(.*?)</h3>", films) == names
    shown = re.findall(r'src="../media/(.*?).mp4"', films)
    assert shown == ["dqn", "sac", "sac-0", "sac-1", "sac-2", "sac-3", "pgpe", "random"]
    assert "<title>Ant: 7 learners of 3 families compared</title>" in crowd
    assert '<details class="statement">' in crowd and 'class="statement" open' not in crowd


def test_many_learners_have_charts_by_family(crowd: str) -> None:
    drawn = charts(crowd)
    assert drawn.keys() <= set(re.findall(r'<div[^>]* id="([\w-]+)"', crowd))
    family, other = drawn["learning_1"], drawn["learning_2"]["layout"]
    named = [trace["name"] for trace in family["data"] if trace.get("showlegend", True)]
    assert named == ["random", "SAC", "sac-0", "sac-1", "sac-2", "sac-3"]
    for axis in ("xaxis", "yaxis"):
        assert family["layout"][axis]["range"] == other[axis]["range"]
    heights = {trace["name"]: trace["visible"] for trace in drawn["heights"]["data"]}
    assert [name for name in heights if heights[name] is True] == ["DQN", "SAC", "PGPE", "random"]
    points = {trace["text"][0] for trace in drawn["cost"]["data"] if "text" in trace}
    assert points == {"", "SAC", "PGPE"}, "of many only those on the front have names"


@pytest.mark.parametrize(
    ("path", "damage", "message"),
    [
        ("media/sac.mp4", Path.unlink, "media/sac.mp4: .*run `dvc repro --force record@sac`"),
        ("results/comparison.json", Path.unlink, "run `dvc repro compare`"),
        ("results/comparison.json", lambda p: p.write_bytes(b"{"), "repro --force compare`"),
        ("models/dqn/seed-7/policy.zip", Path.unlink, "run `dvc repro train@dqn`"),
    ],
)
def test_what_is_missing_is_named(
    project: Path,
    settings: Params,
    tmp_path: Path,
    path: str,
    damage: Callable[[Path], object],
    message: str,
) -> None:
    shutil.copytree(project, tmp_path, dirs_exist_ok=True)
    damage(tmp_path / path)
    with pytest.raises(InputError, match=message):
        page.build(tmp_path, settings)
