"""The live page of this project's own run, where there is one: every agent, in both browsers."""

import json
from pathlib import Path

import firefox
import pytest
from browser import launched, open_page

from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.experiment import params_file
from jumping_ant.play import page

PATH = page.path(PROJECT_ROOT)
AGENTS = list(params_file.load().agents)
MOVES = "window.page?.hasMoved && page.frames[0]?.steps > 2 && page.frames[0].steps < 60"
CHECKED = "document.getElementById('origin-a').textContent.endsWith('recomputed here')"

pytestmark = pytest.mark.skipif(
    not PATH.is_file(), reason="results/play.html is not in git; `dvc repro` makes it"
)


def choice(name: str) -> str:
    seed = f"page.content.agents[{json.dumps(name)}].seeds[0].seed"
    chosen = f"{{ agent: {json.dumps(name)}, seed: {seed}, start: 0 }}"
    return f"page.choose({{ a: {chosen} }}).then(() => null)"


def test_chromium_runs_every_agent() -> None:
    with launched() as chromium:
        visit = open_page(chromium, PATH.as_uri(), width=390, height=420)
        visit.wait_for("Boolean(window.page?.hasMoved)")
        for name in AGENTS:
            visit.page.evaluate(choice(name))
            visit.wait_for(f"page.state.a.agent === '{name}' && {MOVES} && {CHECKED}")
        assert visit.console_errors == visit.page_errors == []
        assert visit.requests == [PATH.as_uri()], "a request left the page"


def test_firefox_runs_every_agent(tmp_path: Path) -> None:
    with firefox.launched(tmp_path / "profile") as window:
        window.open(PATH.as_uri(), 390, 420)
        window.wait_for("Boolean(window.page?.hasMoved)")
        for name in AGENTS:
            window.evaluate(choice(name))
            window.wait_for(f"page.state.a.agent === '{name}' && {MOVES} && {CHECKED}")
        assert window.errors == [] == window.requests
