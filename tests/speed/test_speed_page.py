import json
import re
import shutil
from pathlib import Path

import pytest
from browser import OpenPage
from reported import charts
from small_project import MACHINE, make_params, write_project
from timed_project import Timed, read

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import write_json
from jumping_ant.base.paths import Paths


def test_the_table_shows_times_and_returns_after_equal_ones(timed: Timed, html: str) -> None:
    rows = [" ".join(row.split()) for row in re.findall(r"<tr>(.*?)</tr>", html, re.S)]
    (dqn,) = [row for row in rows if "DQN <small>" in row]
    assert re.findall(r"<td>(\S+)", dqn) == ["500", "500", "500", "–"]
    early = timed.seconds["agents"]["sac"]["return_at_equal_seconds"]
    (sac,) = [row for row in rows if "SAC <small>" in row]
    ends = f"{early['low']:,.0f}, {early['high']:,.0f}"
    assert f"{early['iqm']:,.0f} <small>[{ends}]" in sac
    assert "Return after 100 s" in html


def test_charts_and_claims_are_there(timed: Timed, html: str) -> None:
    drawn = charts(html)
    assert set(drawn) == {"learning_0", "cost", *(f"claim_{number}" for number in range(5))}
    assert set(drawn) <= set(re.findall(r' id="([\w-]+)"', html))
    for name in ("learning_0", "cost"):
        assert drawn[name]["layout"]["xaxis"]["title"]["text"] == "Training time per seed [s]"
    line = drawn["cost"]["data"][0]
    assert (line["name"], line["x"]) == ("Pareto front", [100.0, 4000.0, 4000.0])
    for claim in timed.seconds["claims"]:
        assert claim["text"] in html and claim["evidence"] in html


def test_a_page_of_a_baseline_alone_has_its_times(tmp_path: Path) -> None:
    write_project(tmp_path, {"random": "random"}, [3])
    text = read(tmp_path, make_params({"random": "random"}, [3])).page()
    assert charts(text) == {} and "Return after" not in text
    places, links = (set(re.findall(mark, text)) for mark in (r' id="(\w+)"', r'href="#(\w+)"'))
    assert links <= places


def test_every_machine_is_named_once(timed: Timed, html: str, tmp_path: Path) -> None:
    assert len(re.findall(r'<th scope="row">cpu</th><td>a</td>', html)) == 1
    assert '<th scope="row">torch</th><td>1</td>' in html
    shutil.copytree(timed.root, tmp_path, dirs_exist_ok=True)
    path = Paths(tmp_path).agent("sac").machines
    machines = json.loads(path.read_text(encoding="utf-8"))
    write_json(path, machines | {"7": MACHINE | {"cpu": "another"}})
    assert "<td>another</td>" in read(tmp_path, timed.params).page()
    del machines["7"]
    write_json(path, machines)
    with pytest.raises(InputError, match="given no machine of seed 7, .*--force train@sac"):
        read(tmp_path, timed.params).page()


@pytest.mark.parametrize("width", [390, 1400])
def test_the_page_holds_together_in_a_browser(
    html: str, timed: Timed, open_page: OpenPage, width: int
) -> None:
    visit = open_page(Paths(timed.root).speed_page.as_uri(), width=width)
    visit.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    for name in charts(html):
        assert visit.page.locator(f"#{name} .trace").count() > 0, f"{name} is empty"
    assert visit.page.evaluate("document.documentElement.scrollWidth") <= width
    assert visit.console_errors == visit.page_errors == []
    assert all(request.startswith("file://") for request in visit.requests), visit.requests
