"""The runs that separate luck, contacts and versions in the article's printed value of DQN."""

import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from jumping_ant.article import reproduction
from jumping_ant.base.errors import InputError
from jumping_ant.experiment import presets
from jumping_ant.experiment.models import Params
from jumping_ant.params import article
from jumping_ant.sim import robot
from jumping_ant.sim.env import RobotEnv
from jumping_ant.sim.world import World
from scripts import article_original, article_runs, markdown

NUM_TESTS = 3


@pytest.fixture(autouse=True)
def few_tests(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reproduction, "NUM_TESTS", NUM_TESTS)


@pytest.fixture
def tiny() -> Params:
    """The preset with a training of moments."""
    params = presets.load("article")
    update: dict[str, Any] = {"total_steps": 300, "learning_starts": 100, "buffer_size": 300}
    agents = {"dqn": params.agent("dqn").model_copy(update=update)}
    return params.model_copy(update={"agents": agents})


def test_the_authors_robot_is_ours_but_for_the_contacts() -> None:
    with article_original.ant_file() as path:
        theirs = mujoco.MjModel.from_xml_path(path)
    ours = robot.load(robot.build(article.ROBOT))
    for name in ("body_mass", "body_inertia", "geom_size", "geom_friction", "dof_damping"):
        np.testing.assert_allclose(getattr(theirs, name), getattr(ours, name), err_msg=name)
    np.testing.assert_array_equal(theirs.actuator_gear, ours.actuator_gear)
    np.testing.assert_array_equal(theirs.actuator_trnid, ours.actuator_trnid)
    assert (theirs.geom_margin == 0.01).all() and (ours.geom_margin == 0.005).all()


def test_the_authors_environment_is_ours() -> None:
    """With the versions of today, and its robot's contacts."""
    wide = article.ROBOT.model_copy(update={"contact_margin": None})
    ours = RobotEnv(World(robot.build(wide), article.ENV))
    with article_original.ant_file() as path:
        theirs = article_original.make_env(path)
    np.testing.assert_array_equal(theirs.reset(seed=5)[0], ours.reset(seed=5)[0])
    table = 0.5 * np.array(article.ENV.commands)
    heights = []
    for command in np.random.default_rng(0).integers(5, size=60):
        observation, reward, terminated, *_ = theirs.step(command)
        expected, own_reward, own_end, *_ = ours.step(table[command])
        np.testing.assert_allclose(observation, expected, atol=1e-9)
        assert (reward, terminated) == (pytest.approx(own_reward, abs=1e-9), own_end)
        heights.append(observation[0])
    assert max(heights) > 0.65


def test_the_authors_training_is_tested_as_often_as_asked() -> None:
    with article_original.ant_file() as path:
        returns = article_original.run(path, 3, 2, steps=300, learning_starts=100)
    assert len(returns) == 2 and returns[0] != returns[1] and min(returns) >= 0


def test_contacts_are_all_that_differs_here(tiny: Params) -> None:
    preset = article_runs.ours(tiny, "preset", 3)
    wide = article_runs.ours(tiny, "wide-margin", 3)
    assert len(preset) == len(wide) == NUM_TESTS
    assert not set(preset) & set(wide)
    robot_of_old = tiny.robot.model_copy(update={"contact_margin": 0.01})
    same = tiny.model_copy(update={"robot": robot_of_old})
    assert article_runs.ours(same, "preset", 3) == wide


def test_every_run_has_its_seeds_by_turns() -> None:
    plan = article_runs.plan(list(article_runs.SEEDS))
    assert plan[:4] == [
        ("original", 30), ("preset", 30), ("wide-margin", 30), ("original", 31),
    ]  # fmt: skip
    assert plan[-1] == ("preset", 69)
    assert len(plan) == len(set(plan)) == 16 + 40 + 16
    assert article_runs.plan(["preset"], [99, 7]) == [("preset", 7), ("preset", 99)]


def test_what_is_there_is_not_trained_again(
    tiny: Params, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "tests.csv"
    monkeypatch.setattr(article_runs, "PATH", path)
    monkeypatch.setattr(presets, "load", lambda name: tiny)
    monkeypatch.setattr(sys, "argv", ["article_runs", "--run", "preset", "--seed", "3", "4"])
    article_runs.add(path, "preset", 3, [1.0, 2.0, 3.0])
    article_runs.main()
    found = article_runs.read(path)
    assert list(found) == [("preset", 3), ("preset", 4)]
    assert found["preset", 3] == [1, 2, 3]
    assert found["preset", 4] == pytest.approx(article_runs.ours(tiny, "preset", 4), abs=1e-3)
    np.testing.assert_array_equal(article_runs.tests(path, "preset"), list(found.values()))
    assert article_runs.tests(path, "original").shape == (0, NUM_TESTS)


def test_a_seed_that_lacks_tests_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "tests.csv"
    article_runs.add(path, "original", 30, [1.0, 2.0])
    with pytest.raises(InputError, match="given 2 tests of original 30, allowed: 3; delete"):
        article_runs.read(path)


def test_runs_are_compared_by_their_policies(tmp_path: Path) -> None:
    path, generator = tmp_path / "tests.csv", np.random.default_rng(0)
    for seed in range(8):
        article_runs.add(path, "original", seed, generator.uniform(0, 100, 3).tolist())
        article_runs.add(path, "preset", seed, generator.uniform(0, 100, 3).tolist())
        article_runs.add(path, "wide-margin", seed, generator.uniform(400, 700, 3).tolist())
    summary = article_runs.summary(path)
    alike, apart = summary["pairs"]
    assert (alike["first"], apart["first"]) == ("original", "wide-margin")
    assert alike["p"] > 0.05 and alike["low"] < 0.5 < alike["high"]
    assert apart["probability"] == 1 and apart["p"] == pytest.approx(2 / 12870)  # 16 over 8
    assert summary["runs"]["wide-margin"]["reproduced"] is True
    table = markdown.runs_table(summary)
    assert "| `wide-margin` against `preset` | 100 [100–100] % | 0.00016 |" in table
    assert "| `original` | 8 | " in table and " 0 of 24: " in table


def test_the_table_says_if_no_seed_is_trained(tmp_path: Path) -> None:
    summary = article_runs.summary(tmp_path / "tests.csv")
    assert markdown.runs_table(summary) == "*None of these seeds has been trained yet.*"
