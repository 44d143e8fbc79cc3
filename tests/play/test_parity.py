"""The page's physics and policies against the native ones, in node."""

import json
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import native
import numpy as np
import pytest
from known_policies import policies

from jumping_ant.params import article
from jumping_ant.play import content, vendor
from jumping_ant.play import policies as forms
from jumping_ant.sim import perturbations, robot
from jumping_ant.sim.perturbations import NONE, Condition
from jumping_ant.sim.rollout import Play, returns
from jumping_ant.sim.world import World

# What the sliders of the live page set, each at a level that shows.
CONDITIONS = [
    NONE,
    Condition("gravity", 1.5),
    Condition("friction", 0.1),
    Condition("torso_mass", 1.2),
    Condition("motor_strength", 0.6),
    Condition("damping", 3.0),
    Condition("slope", 20.0),
    Condition("push", 40.0),
    Condition("action_delay", 2.0),
    Condition("observation_delay", 3.0),
]
EXACT = "commands"  # a policy that sees, and whose torques have no rounding
START, STEPS = 7, 30  # the seed of an episode, and its control steps
pytestmark = pytest.mark.skipif(
    not shutil.which("node"), reason="no node here; run `scripts/environment.sh browser`"
)


def world_of(kind: str) -> World:
    """Return a short task of the article's robot, or of a planar one."""
    env = article.ENV.model_copy(update={"max_episode_steps": STEPS})
    if kind == "ant":
        return World(robot.build(article.ROBOT), env)
    source = robot.source_path(kind).read_text(encoding="utf-8")
    terms = dict.fromkeys(("forward_velocity", "alive", "control_cost", "upright"), {"weight": 0.5})
    reward = env.reward.model_validate(env.reward.model_dump() | terms)
    limits = {"min_torso_height": 0.7, "max_tilt": 0.6, "commands": [[0.0] * 3], "reward": reward}
    return World(source, env.model_copy(update=limits))


def in_node(folder: Path, world: World, tasks: Sequence[Any]) -> list[Any]:
    """Return what the modules of a page of one robot answer in node (`parity.mjs`)."""
    libraries = vendor.files()
    (folder / "mujoco.mjs").write_bytes(libraries["mujoco.js"])
    (folder / "mujoco.wasm").write_bytes(libraries["mujoco.wasm"])
    page_content = {
        "robots": {"robot": content.robot_to_json(world)},
        "task": content.task_to_json(world.env) | {"dt": world.dt},
        "sliders": [],
    }
    command = ["node", str(Path(__file__).with_name("parity.mjs")), str(folder)]
    request = json.dumps({"content": page_content, "tasks": tasks})
    done = subprocess.run(command, input=request, capture_output=True, encoding="utf-8")
    assert done.returncode == 0, done.stderr
    return list(json.loads(done.stdout))


WORLDS = {kind: world_of(kind) for kind in ("ant", "hopper")}
KNOWN = {
    kind: policies(world.anatomy.num_observations, world.anatomy.num_motors)
    for kind, world in WORLDS.items()
}


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Any]]:
    """What node answers for each robot: errors of each policy, then returns of some episodes."""
    answered, folder = {}, tmp_path_factory.mktemp("node")
    for kind, world in WORLDS.items():
        tasks = [
            {
                "policy": forms.to_json(policy),
                "reference": native.record(world, policy, "robot", START, longest=5 * STEPS),
            }
            for policy in KNOWN[kind].values()
        ]
        start = content.start(world, START)
        tasks += [
            {
                "policy": forms.to_json(KNOWN[kind][EXACT]),
                "robot": "robot",
                "starts": [start],
                "levels": {} if condition == NONE else {condition.perturbation: condition.level},
            }
            for condition in (CONDITIONS if kind == "ant" else [NONE])
        ]
        answered[kind] = in_node(folder, world, tasks)
    return answered


@pytest.mark.parametrize("kind", ["ant", "hopper"])
def test_a_control_step_agrees_up_to_rounding(answers: dict[str, list[Any]], kind: str) -> None:
    for own in answers[kind][: len(policies(2, 1))]:
        assert own["one_step_error"] < 1e-11
        assert own["max_error"] < 1e-10
        assert own["horizon"] > native.STEPS


@pytest.mark.parametrize("kind", ["ant", "hopper"])
@pytest.mark.parametrize("policy", policies(2, 1))
def test_torques_agree_up_to_single_precision(
    answers: dict[str, list[Any]], kind: str, policy: str
) -> None:
    own = answers[kind][list(policies(2, 1)).index(policy)]
    exact = ("cycle", "uniform", "levels", "command")
    assert own["policy_error"] <= (0 if any(word in policy for word in exact) else 1e-6)


def test_every_term_of_the_reward_agrees(answers: dict[str, list[Any]]) -> None:
    (own,) = answers["hopper"][-1]
    expected = returns(WORLDS["hopper"], [Play(KNOWN["hopper"][EXACT], START)])
    assert own == pytest.approx(expected[0], rel=1e-9)


@pytest.mark.parametrize("number", range(len(CONDITIONS)), ids=lambda i: CONDITIONS[i].perturbation)
def test_sliders_perturb_as_the_robustness_stage_does(
    answers: dict[str, list[Any]], number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The page's slopes and pushes are along x.
    monkeypatch.setattr(perturbations, "_direction", lambda *_: np.array([1.0, 0.0]))
    condition = CONDITIONS[number]
    (expected,) = returns(WORLDS["ant"], [Play(KNOWN["ant"][EXACT], START, condition)])
    (own,) = answers["ant"][number - len(CONDITIONS)]
    assert own == pytest.approx(expected, rel=1e-9)
    undisturbed = answers["ant"][-len(CONDITIONS)][0]
    assert (condition == NONE) or abs(own - undisturbed) > 1e-3 * abs(undisturbed)
