import shutil
from pathlib import Path

import numpy as np
import pytest
from browser import OpenPage
from reported import AGENTS, charts

from jumping_ant.base.files import write_bytes, write_text
from jumping_ant.media import rendering


@pytest.mark.parametrize("width", [390, 1400])
def test_the_page_holds_together_in_a_browser(
    html: str, project: Path, open_page: OpenPage, width: int
) -> None:
    address = (project / "results" / "report.html").as_uri()
    visit = open_page(address, width=width)
    page = visit.page
    assert page.evaluate("undrawn.size") > 0, "charts far from the window wait"
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    for name in charts(html):
        box = page.locator(f"#{name} .main-svg").first.bounding_box()
        assert box and box["width"] > 200 and box["height"] > 180, name
        assert page.locator(f"#{name} .trace, #{name} .hm").count() > 0, f"{name} is empty"
    assert page.evaluate("document.documentElement.scrollWidth") <= width, "it scrolls sideways"
    for video in page.locator("video").all():
        box = video.bounding_box()
        assert box and box["x"] >= 0 and box["x"] + box["width"] <= width
    assert visit.console_errors == visit.page_errors == []
    assert all(request.startswith("file://") for request in visit.requests), visit.requests


def test_only_films_in_the_window_play(project: Path, open_page: OpenPage, html: str) -> None:
    address = (project / "results" / "report.html").as_uri()
    visit = open_page(address, width=390, height=300)
    first, last = (f"document.querySelectorAll('video')[{index}]" for index in (0, 3))
    assert visit.page.evaluate(f"{first}.paused && {last}.paused")
    visit.page.locator("video").nth(3).scroll_into_view_if_needed()
    visit.wait_for(f"{last}.currentTime > 0.2")
    assert visit.page.evaluate(f"{first}.paused && {first}.currentTime === 0")
    visit.page.locator("video").nth(0).scroll_into_view_if_needed()
    visit.wait_for(f"{first}.currentTime > 0.2 && {last}.paused")
    assert visit.page_errors == []


def test_films_of_any_length_play_together_and_can_be_moved(
    project: Path, open_page: OpenPage, html: str, tmp_path: Path
) -> None:
    shutil.copytree(project / "media", tmp_path / "media")
    write_text(tmp_path / "results" / "report.html", html)
    short = rendering.encode(np.zeros((4, 64, 64, 3), np.uint8), fps=10)
    write_bytes(tmp_path / "media" / "random.mp4", short)
    (tmp_path / "media" / "dqn.mp4").unlink()
    visit = open_page((tmp_path / "results" / "report.html").as_uri())
    page = visit.page
    short, long, other = (f"document.querySelectorAll('video')[{index}]" for index in (3, 2, 1))
    is_held = f"Math.abs({short}.currentTime - {short}.duration) < 0.01"
    visit.wait_for(f"{long}.currentTime > 0.1")
    page.click("#play")
    assert page.inner_text("#play") == "Play"
    assert page.evaluate(f"{short}.paused && {long}.paused")
    end = page.evaluate(f"{long}.duration")
    assert page.evaluate(f"{short}.duration") == pytest.approx(0.4)
    assert end > 1 and float(str(page.get_attribute("#time", "max"))) == end
    page.locator("#time").fill("0.7")
    visit.wait_for(f"{long}.currentTime === 0.7 && {is_held}")
    assert page.evaluate("document.getElementById('heights').layout.shapes[0].x0") == 0.7
    assert page.get_attribute("#time", "aria-valuetext") == page.inner_text("#clock") == "0.7 s"
    page.select_option("#speed", "0.25")
    page.click("#play")
    assert page.inner_text("#play") == "Pause"
    visit.wait_for(f"{long}.currentTime > 0.75 && {is_held}")
    times = [page.evaluate(f"{film}.currentTime") for film in (long, other)]
    assert abs(times[0] - times[1]) < 0.3
    assert visit.page_errors == []
    assert all("ERR_FILE_NOT_FOUND" in error for error in visit.console_errors)


def test_the_menu_changes_the_measure(project: Path, open_page: OpenPage, html: str) -> None:
    visit = open_page((project / "results" / "report.html").as_uri(), width=1400)
    page = visit.page
    page.locator("#episodes").scroll_into_view_if_needed()
    page.locator("#episodes .updatemenu-header").click()
    page.locator("#episodes .updatemenu-dropdown-button", has_text="Work").click()
    visit.wait_for("document.getElementById('episodes').layout.xaxis.title.text === 'Work [J]'")
    shown = "document.getElementById('episodes').data.filter((box) => box.visible === true)"
    assert page.evaluate(f"{shown}.length") == len(AGENTS)
    assert page.evaluate(f"{shown}[2].x[0]") == pytest.approx(2 * 4995)
