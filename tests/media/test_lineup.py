"""The agents side by side: each one's scene below its name, and their heights together."""

import dataclasses
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded import Content, simulate, story
from small_project import make_params, shown, write_project

from jumping_ant.agents.families import Family
from jumping_ant.base.errors import InputError
from jumping_ant.media import about, layout, lineup, style
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World

ALGORITHMS = {"random": "random", "mine": "sac"}


@pytest.fixture(scope="module")
def episodes(world: World) -> dict[str, Trajectory]:
    """One falls from low and one from high, for half a second and a second."""
    return {
        "random": simulate(world.model, np.zeros((10, 8)), height=1.0),
        "mine": simulate(world.model, np.zeros((20, 8)), height=1.5, upward_speed=2.0),
    }


@pytest.fixture(scope="module")
def content(
    world: World, episodes: dict[str, Trajectory], tmp_path_factory: pytest.TempPathFactory
) -> Content:
    path = tmp_path_factory.mktemp("lineup") / "lineup.rrd"
    stories = {
        "random": story("random", "random", 330.0, robot="unedited"),
        "mine": story("mine", "sac", 2100.0),
    }
    worlds = dict.fromkeys(episodes, world)
    path.write_bytes(lineup.record(worlds, episodes, stories).content)
    return Content(path)


def test_every_agent_has_a_scene_and_a_height(
    content: Content, episodes: dict[str, Trajectory]
) -> None:
    for agent, episode in episodes.items():
        places = episode.qpos[::2, :3]
        torso = content.column(f"/{agent}/world/torso", "Transform3D:translation")
        np.testing.assert_allclose(torso, places, atol=1e-5)
        np.testing.assert_allclose(content.scalars(f"/height/{agent}"), places[:, 2])
        times = 20_000_000 * np.arange(len(places))
        np.testing.assert_array_equal(content.times(f"/height/{agent}"), times)
        assert {f"/{agent}/world/torso/torso_geom", f"/{agent}/world/floor"} <= set(content.still)
        assert {f"/{agent}/trail", f"/{agent}/contact_arrow/back_leg"} <= set(content.moving)


def test_agents_have_the_colours_of_the_figures(content: Content) -> None:
    families: dict[str, Family] = {"random": "baseline", "mine": "off-policy actor-critic"}
    for agent, look in style.looks(families).items():
        color = int(look.colour[1:] + "ff", 16)
        paths = (f"/height/{agent}", f"/{agent}/trail", f"/{agent}/world/torso/torso_geom")
        assert {int(content.shape(path)["colors"]) for path in paths} == {color}


def test_the_page_lists_the_returns(content: Content) -> None:
    text = str(content.shape("/about")["text"])
    assert "| **random** (baseline, unedited robot) | 4 | 330 | 165 | 2.50 m | 12 |" in text
    assert "| **mine** | 4 | 2,100 | 1,050 | 2.50 m | 12 |" in text
    peak = 2.0 / 9.81  # [s] up from a start at 2 m/s
    shown = re.search(r"highest jump of the first 1 s, at (\S+) s", text)
    assert shown and float(shown[1]) == pytest.approx(peak, abs=0.06)


def test_many_learners_are_in_tabs_by_family_the_best_first(world: World) -> None:
    stories = {"random": story("random", "random", 300.0)}
    stories |= {f"dqn-{i}": story(f"dqn-{i}", "dqn", 100.0 * i) for i in range(3)}
    stories |= {f"sac-{i}": story(f"sac-{i}", "sac", 900.0 - i) for i in range(3)}
    assert lineup._groups(stories) == {"All agents": list(stories)}
    stories["pgpe"] = story("pgpe", "pgpe", 50.0)
    groups = lineup._groups(stories)
    assert groups == {
        "Best of each family": ["dqn-2", "sac-0", "pgpe", "random"],
        "Value-based": ["dqn-2", "dqn-1", "dqn-0"],
        "Off-policy actor-critic": ["sac-0", "sac-1", "sac-2"],
        "Evolution": ["pgpe"],
        "Baseline": ["random"],
    }
    labels = {name: name.upper() for name in stories}
    blueprint = layout.lineup_layout(dict.fromkeys(stories, world), labels, groups, 0, 1)
    tabs, page = blueprint.root_container.contents
    assert page.origin == "about"
    for tab, (title, agents) in zip(tabs.contents, groups.items(), strict=True):
        grid, heights = tab.contents
        assert tab.name == title
        assert [view.name for view in grid.contents] == [labels[agent] for agent in agents]
        assert heights.contents == [f"/height/{agent}" for agent in agents]


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Results in which seed 3 of `mine` returns 3,000 on average, 2,995 in episode 0."""
    write_project(tmp_path, ALGORITHMS, seeds=[3, 4])
    return tmp_path


def test_a_story_is_read_from_the_results(project: Path, episodes: dict[str, Trajectory]) -> None:
    episode = shown(project, "mine", episodes["mine"])
    mine = about.read(project, make_params(ALGORITHMS, [3, 4]), "mine", episode)
    assert (mine.agent, mine.algorithm, mine.label, mine.robot) == ("mine", "sac", "mine", "edited")
    measures = {"return": 2995.0, "peak_height": 2.995, "jumps": 12.0, "airborne_seconds": 6.5}
    assert mine.measures == measures
    assert mine.mean_return == pytest.approx(3005.0)


@pytest.mark.parametrize(
    "change", [{"seed": 5}, {"episode": 1}, {"episode_return": 2995.5}, {"agent": "random"}]
)
def test_a_story_of_another_episode_is_refused(
    project: Path, episodes: dict[str, Trajectory], change: dict[str, Any]
) -> None:
    episode = dataclasses.replace(shown(project, "mine", episodes["mine"]), **change)
    with pytest.raises(InputError, match=r"mine/trajectory.npz: given an episode of agent .*mine`"):
        about.read(project, make_params(ALGORITHMS, [3, 4]), "mine", episode)
