"""The live page in Chromium, without a network: all agents, every control."""

import json
from base64 import b64encode
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import native
import pytest
from browser import Visit, launched, open_page

from jumping_ant.base.paths import Paths
from jumping_ant.params.model import Params
from jumping_ant.play import content
from jumping_ant.policies import trained_policy
from jumping_ant.sim import robot
from jumping_ant.sim.world import World

MOVED = "Boolean(window.page?.hasMoved)"
HEIGHT = "page.plots.histories[0].at(-1)?.height"
STEPS = "page.frames[0]?.steps"
FOLLOW = "(link) => { page.hash = ''; location.hash = '#'; location.hash = link; }"


@pytest.fixture(scope="module")
def visit(live: str) -> Iterator[Visit]:
    """The page in Chromium, in a wide window."""
    with launched() as chromium:
        visit = open_page(chromium, live, width=390, height=420)
        visit.wait_for(MOVED)
        yield visit
        assert visit.console_errors == visit.page_errors == []
        assert visit.requests == [live], "a request left the page"


def ask(visit: Visit, kind: str, **job: Any) -> Any:
    return visit.page.evaluate(f"(job) => page.physics.ask('{kind}', job)", job)


def test_every_agent_runs_with_a_checked_policy(visit: Visit, settings: Params) -> None:
    for name in settings.agents:
        visit.page.select_option("#agent-a", name)
        visit.wait_for(
            f"page.state.a.agent === '{name}' && "
            "document.getElementById('origin-a').textContent.endsWith('recomputed here')"
        )
        steps = visit.page.evaluate(f"{STEPS} ?? 0")
        visit.wait_for(f"{STEPS} > 2 && {STEPS} !== {steps}")
    assert visit.page.locator("#seed-a option").all_inner_texts()[0] == "1 (best in validation)"


def test_physics_agrees_with_the_native_simulator_here_too(
    visit: Visit, project: Path, settings: Params
) -> None:
    world = World(robot.read(project), settings.env)
    for name in ("sac", "pgpe"):
        paths = Paths(project).agent(name).seed(1)
        policy = trained_policy.load(paths)
        reference = native.record(world, policy, "edited", 9, longest=100)
        form = content.policy(project, name, 1)
        own = ask(visit, "verify", policy=form, reference=reference)
        assert own["one_step_error"] < 1e-11 and own["max_error"] < 1e-10
        assert own["horizon"] == 100 and own["policy_error"] < 1e-6


def test_the_robot_can_be_dragged_and_pushed(visit: Visit) -> None:
    visit.page.select_option("#agent-a", "open_loop")
    visit.page.click("#restart")
    visit.page.evaluate("page.stage.draw()")
    box = visit.page.locator("#stage").bounding_box()
    spot = visit.page.evaluate(
        """() => { const { width, height } = page.stage;
        for (let y = 10; y < height; y += 6) for (let x = 10; x < width; x += 6)
          if (page.stage.hit(x, y)?.slot === 0) return [x, y]; }"""
    )
    assert box and spot, "the robot is not in the picture"
    mouse = visit.page.mouse
    mouse.move(box["x"] + spot[0], box["y"] + spot[1])
    mouse.down()
    mouse.move(box["x"] + spot[0], box["y"] + 2, steps=4)
    visit.wait_for(f"{HEIGHT} > 1.6")  # no jump of this agent gets there
    mouse.up()
    visit.wait_for(f"{HEIGHT} < 1.2")
    visit.page.locator("#stage").focus()
    before = visit.page.evaluate("page.frames[0].current.torso[0]")
    for _ in range(3):
        visit.page.keyboard.press("ArrowUp")
    visit.wait_for(f"page.frames[0].current.torso[0] > {before} + 0.5")
    assert visit.page.inner_text("#status") == "pushed forward with 40 N"


def test_every_control_is_reached_and_works_by_keyboard(visit: Visit) -> None:
    own, keys = visit.page, visit.page.keyboard
    own.locator("#stage").focus()
    wanted = own.evaluate(
        """[...document.querySelectorAll('button, select, input, summary, a, #stage')]
        .filter((one) => one.checkVisibility() && !one.disabled)
        .map((one) => one.id || one.textContent)"""
    )
    reached = ["stage"]
    for _ in wanted[1:]:
        keys.press("Tab")
        reached.append(
            own.evaluate("document.activeElement.id || document.activeElement.textContent")
        )
    assert reached == wanted
    own.locator("#run").focus()
    if own.inner_text("#run") == "Pause":
        keys.press("Enter")
    assert own.inner_text("#run") == "Run"
    own.evaluate("document.activeElement.blur()")
    before = own.evaluate(STEPS)
    keys.press(".")
    visit.wait_for(f"{STEPS} === {before} + 1")
    keys.press("r")
    visit.wait_for(f"{STEPS} === 0")
    keys.press("d")
    assert "torso at" in own.inner_text("#status")
    own.locator("#slider-gravity").focus()
    keys.press("ArrowRight")
    assert own.evaluate("page.state.levels.gravity") == pytest.approx(1.03)
    assert "gravity=1.03" in own.evaluate("location.hash")
    own.locator("#usual").focus()
    keys.press("Enter")
    assert own.evaluate("page.state.levels") == {}
    own.evaluate("document.activeElement.blur()")
    keys.press(" ")
    assert own.inner_text("#run") == "Pause"


def test_a_visitor_drives_with_five_keys_beside_an_agent(visit: Visit) -> None:
    own = visit.page
    own.select_option("#agent-a", "you, with keys 1 to 5")
    own.select_option("#agent-b", "sac")
    visit.wait_for("page.frames.every((own) => own)")
    own.evaluate("document.activeElement.blur()")
    own.keyboard.press("4")
    torques = "[...page.plots.histories[0].at(-1).torques]"
    visit.wait_for(f"String({torques}) === '1,1,1,1,-1,-1,-1,-1'")
    assert own.locator("#commands [aria-pressed=true]").inner_text() == "4"
    assert all("steps" in own.inner_text(f"#here-{slot}") for slot in "ab")
    own.select_option("#agent-b", "")


def test_a_link_carries_the_very_moment(visit: Visit) -> None:
    own = visit.page
    own.select_option("#agent-a", "dqn")
    own.select_option("#speed", "0.25")
    visit.wait_for(f"{STEPS} > 8 && page.state.a.agent === 'dqn'")
    own.click("#run")
    own.wait_for_timeout(100)
    own.click("#link")
    visit.wait_for("location.hash.includes('moment')")
    link = own.evaluate("location.hash")
    own.click("#step")
    own.wait_for_timeout(200)
    expected = ask(visit, "save")
    own.evaluate(FOLLOW, link)
    visit.wait_for(f"{STEPS} === {expected[0][1]['steps']} - 1")
    own.click("#step")
    visit.wait_for(f"{STEPS} === {expected[0][1]['steps']}")
    ((_, found),), ((_, wanted),) = ask(visit, "save"), expected
    assert found["steps"] == wanted["steps"]
    assert found["state"][:29] == pytest.approx(wanted["state"][:29], abs=1e-9)
    assert own.input_value("#speed") == "0.25"
    own.select_option("#speed", "1")


def test_a_link_to_an_episode_that_has_ended_plays_no_step(visit: Visit) -> None:
    own = visit.page
    own.click("#run")
    moment = ask(visit, "save")
    moment[0][1] |= {"ended": True, "substep": 0}
    link = f"#a=dqn.1.0&run=1&moment={b64encode(json.dumps(moment).encode()).decode()}"
    own.evaluate(FOLLOW, link)
    visit.wait_for(f"page.frames[0]?.ended && {STEPS} === {moment[0][1]['steps']}")
    own.wait_for_timeout(200)
    ((_, saved),) = ask(visit, "save")
    assert saved["ended"] and saved["steps"] == moment[0][1]["steps"]
    own.click("#restart")


def test_a_round_against_the_metronome_ends_with_scores(visit: Visit) -> None:
    own = visit.page
    own.evaluate("page.game.seconds = 2")
    own.click("#game-start")
    visit.wait_for("page.game.running")
    own.keyboard.press("j")
    assert own.get_attribute("#beat-1", "aria-pressed") == "true"
    visit.wait_for("document.getElementById('game-result').textContent.includes('open_loop')")
    assert own.inner_text("#game-result").startswith(("You beat", "The metronome wins"))


def test_it_fits_small_screens(visit: Visit) -> None:
    own = visit.page
    own.set_viewport_size({"width": 390, "height": 800})
    assert own.evaluate("document.documentElement.scrollWidth") <= 390, "it scrolls sideways"
    own.set_viewport_size({"width": 390, "height": 420})
