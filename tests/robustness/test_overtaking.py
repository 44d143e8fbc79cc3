"""The best learner and a metronome under a perturbation, filmed and recorded."""

from pathlib import Path
from typing import Any

import imageio.v3 as iio
import numpy as np
import pytest
from recorded import Content
from rerun.chunk import RrdReader
from small_project import make_params, write_perturbed, write_project

from jumping_ant.actions import ActionSet
from jumping_ant.base.errors import InputError
from jumping_ant.comparison.results import load
from jumping_ant.experiment import params_file
from jumping_ant.experiment.models import Params
from jumping_ant.params.blocks import PerturbationParams, RobustnessParams
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.policies.policy import Policy
from jumping_ant.recording import overtaking
from jumping_ant.robustness import playing, recorded, summary
from jumping_ant.robustness.perturbations import NONE, Condition
from jumping_ant.robustness.playing import Case
from jumping_ant.robustness.recorded import Player
from jumping_ant.sim.world import World

START, STEPS = 9_000_000, 20


@pytest.fixture(scope="module")
def world(robot_xml: str, known_params: Params) -> World:
    return World(robot_xml, known_params.env)


@pytest.fixture(scope="module")
def policy() -> Policy:
    weight = np.random.default_rng(0).normal(0, 0.3, (8, 27)).astype(np.float32)
    zeros, ones = np.zeros(27, np.float32), np.ones(27, np.float32)
    return LinearPolicy(weight, zeros[:8], zeros, ones, weight, zeros[:8], ActionSet(hold=2))


@pytest.mark.parametrize(
    "condition",
    [NONE, Condition("action_delay", 2.0), Condition("gravity", 2.0), Condition("integration", 10)],
)
def test_a_recorded_episode_is_the_one_that_counts(
    world: World, policy: Policy, condition: Condition
) -> None:
    episode = recorded.play(world, STEPS, Player("mine", 3, policy), condition, START)
    case = Case(condition, 3, START)
    (expected,) = playing.returns(world, STEPS, "sac", {3: policy}, [case])
    assert episode.episode_return == pytest.approx(expected, abs=1e-12)
    assert episode.frame_skip == (10 if condition.perturbation == "integration" else 5)
    assert episode.timestep * episode.frame_skip == pytest.approx(world.dt)
    assert episode.qpos.shape == (STEPS * episode.frame_skip + 1, 15)
    heights = world.anatomy.heights(episode.qpos[episode.frame_skip :: episode.frame_skip])
    assert episode.terms["torso_height"] == pytest.approx(np.clip(heights - 0.6, 0, 1) * 10)
    late = condition.perturbation == "action_delay"
    assert (episode.torques[:2] == 0).all() == late


AGENTS = {"beat": "open_loop", "sac": "sac", "random": "random"}
ROBUSTNESS = RobustnessParams(
    episodes=1,
    episode_steps=STEPS,
    perturbations=PerturbationParams(push=[1.0, 2.0, 3.0]),
    filmed="push",
)


def filmed(root: Path, agents: dict[str, str], robustness: RobustnessParams, most: float) -> Any:
    """Return who is filmed if SAC keeps so much, and less with every level and seed."""
    params = make_params(agents, range(5)).model_copy(update={"robustness": robustness})
    write_project(root, agents, params.seeds)

    def kept(name: str, condition: Condition, seed: int) -> float:
        return 0.5 if name == "beat" else most - 0.1 * condition.level - 0.01 * seed

    write_perturbed(root, params, kept)
    return summary.summarize(root, params, load(root, params))["filmed"]


@pytest.mark.parametrize(("fps", "steps"), [(25, [50, 10]), (20, [50, 7])])
def test_time_steps_that_give_whole_frames_may_be_filmed(
    known_params: Params, fps: int, steps: list[int]
) -> None:
    content = known_params.model_dump()
    content["record"]["fps"] = fps
    content["robustness"]["perturbations"]["integration"] = steps
    content["robustness"]["filmed"] = "integration"
    recorded.check_film(params_file.check(content), 0.05)
    content["robustness"]["perturbations"]["integration"] = [*steps, 3]
    content["record"]["fps"] = 25
    told = r"robustness.filmed: given integration, of .*, 3 steps per 0.05 s, allowed: "
    with pytest.raises(InputError, match=told):
        recorded.check_film(params_file.check(content), 0.05)
    content["robustness"]["filmed"] = "push"
    recorded.check_film(params_file.check(content), 0.05)


def test_the_best_learner_is_filmed_where_it_is_overtaken(tmp_path: Path) -> None:
    found = filmed(tmp_path, AGENTS, ROBUSTNESS, most=0.68)  # 0.46 on average at level 2
    assert list(found["agents"]) == ["sac", "beat"]
    assert found["agents"] == pytest.approx({"sac": 460.0, "beat": 500.0})
    assert (found["perturbation"], found["level"], found["seed"]) == ("push", 2.0, 2)


def test_a_lead_within_the_margin_is_not_yet_filmed(tmp_path: Path) -> None:
    """SAC returns 499.9 at level 2, the metronome 500: in 20 of 1,000 steps the margin is 0.2."""
    assert filmed(tmp_path, AGENTS, ROBUSTNESS, most=0.7199)["level"] == 3.0


def test_a_learner_that_stays_ahead_is_filmed_at_the_end(tmp_path: Path) -> None:
    assert filmed(tmp_path, AGENTS, ROBUSTNESS, most=2.0)["level"] == 3.0


@pytest.mark.parametrize("agents", [{"random": "random"}, {"sac": "sac"}])
def test_without_a_pair_the_best_agent_is_filmed(tmp_path: Path, agents: dict[str, str]) -> None:
    found = filmed(tmp_path, agents, ROBUSTNESS, most=0.7)
    assert list(found["agents"]) == list(agents)
    assert (found["perturbation"], found["level"], found["seed"]) == ("none", 0.0, 0)
    assert all(mean > 300 for mean in found["agents"].values()), "as in the undisturbed episodes"


def test_without_a_perturbation_it_is_filmed_undisturbed(tmp_path: Path) -> None:
    none = ROBUSTNESS.model_copy(update={"filmed": None})
    assert filmed(tmp_path, AGENTS, none, most=0.7)["perturbation"] == "none"


def test_only_what_is_played_can_be_filmed(known_params: Params) -> None:
    content = known_params.model_dump()
    content["robustness"]["perturbations"]["push"] = []
    content["robustness"]["filmed"] = "push"
    with pytest.raises(InputError, match="robustness.filmed: given 'push', allowed: null, or"):
        params_file.check(content)


@pytest.fixture(scope="module")
def shown(world: World, policy: Policy, known_params: Params) -> dict[str, Any]:
    """Two agents, one of which falls at once."""
    block = known_params.agents["sac"]
    params = known_params.model_copy(update={"agents": {"high": block, "low": block}})
    low = World(
        world.xml, world.env.model_copy(update={"min_torso_height": 0.74, "reset_noise_scale": 0.0})
    )
    worlds = {"high": world, "low": low}
    conditions = {"high": NONE, "low": Condition("gravity", 30.0)}
    episodes = {
        name: recorded.play(own, STEPS, Player(name, 0, policy), conditions[name], START)
        for name, own in worlds.items()
    }
    assert len(episodes["low"].torques) < len(episodes["high"].torques) == STEPS
    stories = {name: overtaking.story(params, name, 5.0) for name in worlds}
    return {"worlds": worlds, "trajectories": episodes, "stories": stories}


def test_the_film_has_both_and_their_names(shown: dict[str, Any], known_params: Params) -> None:
    small = {"width": 128, "height": 128, "fps": 20, "seconds": 5.0, "shadow_size": 0}
    film = overtaking.film(**shown, params=known_params.record.model_copy(update=small))
    pictures = iio.imread(film, extension=".mp4")
    assert pictures.shape == (STEPS + 1, 128, 256, 3)
    for half in (pictures[:, :, :128], pictures[:, :, 128:]):
        assert (half[:, 8:32, 12:80].min(axis=3) > 220).any(axis=(1, 2)).all(), "a white name"
    moved = np.abs(np.diff(pictures.astype(int), axis=0)).max(axis=(1, 3)) > 40
    assert moved[-1, :128].any() and not moved[-3:, 128:].any(), "its last picture stays"


def test_the_recording_tells_what_it_shows(shown: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "overtaking.rrd"
    path.write_bytes(overtaking.record(**shown, condition="push of 2"))
    (entry,) = RrdReader(path).recordings()
    assert entry.recording_id == "overtaking"
    text = str(Content(path).shape("/about")["text"])
    assert "Both start alike, with push of 2." in text
    assert "| **high**" in text and "| **low**" in text
