"""Addresses with the page's state in node: whatever they hold, the page gets what it can use."""

import json
import shutil
import subprocess
from base64 import b64encode
from typing import Any

import pytest

from jumping_ant.base.files import CODE_ROOT

SEED = {"seed": 30, "starts": [{"qpos": [0, 0, 0], "qvel": [0, 0]}]}
CONTENT = {
    "agents": {"sac": {"robot": "edited", "seeds": [SEED]}},
    "robots": {"edited": {"motors": ["hip"]}},
    "sliders": [],
    "task": {"max_episode_steps": 100, "frame_skip": 5},
}
pytestmark = pytest.mark.skipif(
    not shutil.which("node"), reason="no node here; run `scripts/environment.sh browser`"
)
USUAL = {"a": None, "b": None, "speed": 1, "running": True, "levels": {}}
PARSE = """
const { format, parse } = await import(process.argv[1]);
const [text, content, usual] = JSON.parse(process.argv[2]);
const state = parse(text, content, usual);
process.stdout.write(JSON.stringify([state, parse(format(state), content, usual)]));
"""
SAVED: dict[str, Any] = {
    "steps": 7,
    "total": 1.5,
    "substep": 2,
    "ended": False,
    "state": [0.1] * 7,
    "torques": [0.5],
}


def parsed(text: str) -> dict[str, Any]:
    """Return the state of an address, and see that its own address gives the same."""
    link = (CODE_ROOT / "jumping_ant" / "play" / "link.js").as_uri()
    arguments = [link, json.dumps([text, CONTENT, USUAL])]
    command = ["node", "--input-type=module", "-e", PARSE, *arguments]
    done = subprocess.run(command, capture_output=True, encoding="utf-8")
    assert done.returncode == 0, done.stderr
    state, again = json.loads(done.stdout)
    assert state == again
    return state


def link(moment: object) -> str:
    return f"#a=sac.30.0&moment={b64encode(json.dumps(moment).encode()).decode()}"


def test_a_moment_is_kept() -> None:
    older = {name: value for name, value in SAVED.items() if name != "ended"}
    at_the_end = SAVED | {"steps": 100, "substep": 0, "ended": True}
    for saved in (SAVED, older, at_the_end):
        assert parsed(link([[0, saved]]))["moment"] == [[0, saved]]


def test_a_name_that_every_object_has_is_no_agent() -> None:
    for name in ("constructor", "__proto__", "toString"):
        assert parsed(f"#a={name}.1.0") == {**USUAL, "moment": None}


@pytest.mark.parametrize(
    "moment",
    [
        5,
        {},
        [0],
        [[2, SAVED]],
        [[1, SAVED]],  # there is no second robot
        [[0, None]],
        *([[0, SAVED | {"steps": value}]] for value in (1e12, 101, -1, 0.5, "7", None)),
        *([[0, SAVED | {"substep": value}]] for value in (5, -1, None)),
        [[0, SAVED | {"ended": True}]],  # within a step
        [[0, SAVED | {"ended": 1}]],
        [[0, SAVED | {"total": None}]],
        *([[0, SAVED | {"state": value}]] for value in ([0.1] * 6, [0.1] * 8, [None] * 7, None)),
        *([[0, SAVED | {"torques": value}]] for value in ([], [0, 0], ["0"], "0")),
    ],
)
def test_what_no_page_has_saved_is_no_moment(moment: object) -> None:
    state = parsed(link(moment))
    assert state["moment"] is None and state["a"]["agent"] == "sac"
