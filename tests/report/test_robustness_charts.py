"""The report's charts of what agents keep under perturbations."""

from pathlib import Path

from reported import charts

from jumping_ant.base.files import read_json
from jumping_ant.base.paths import Paths


def test_what_agents_withstand_is_shown_with_its_levels(html: str, project: Path) -> None:
    found = read_json(Paths(project).robustness, "")
    drawn = charts(html)
    (table,) = drawn["withstood"]["data"]
    assert table["y"] == ["DQN", "SAC", "PGPE"], "by family, without random actions"
    assert [name.lower().replace(" ", "_") for name in table["x"]] == found["perturbations"]
    for label, row, texts in zip(table["y"], table["z"], table["text"], strict=True):
        own = found["agents"][label.lower()]
        assert row == [own[name]["retention"][-1] for name in found["perturbations"]]
        assert texts == [f"{100 * share:.0f}" for share in row]
    lines = drawn["levels"]["data"]
    assert len(lines) == 3 * len(found["perturbations"])
    assert [line["visible"] for line in lines] == [True] * 3 + [False] * (len(lines) - 3)
    assert lines[0]["x"] == ["0.3", "0.5", "0.8", "1.2", "1.7", "2.3", "3"]
    titles = [
        own["args"][1]["xaxis.title.text"]
        for own in drawn["levels"]["layout"]["updatemenus"][0]["buttons"]
    ]
    assert titles[0] == "Mass of the torso [kg]"
    assert "Age of observations [control steps]" in titles
