"""A robot of the native simulator: the robustness stage's episodes, and what visitors do to it."""

import json

import numpy as np
import pytest
from slider_conditions import CONDITIONS
from small_policies import NUMBERS

from jumping_ant.experiment.models import Params
from jumping_ant.play import content
from jumping_ant.robustness.perturbations import NONE, Condition
from jumping_ant.robustness.perturbed import PerturbedVectorEnv
from jumping_ant.sim import rollout
from jumping_ant.sim.world import World
from jumping_ant.watching.simulation import Simulation

POLICY = NUMBERS["linear"]
START, STEPS = 7, 25
NOISY = Condition("observation_noise", 0.1)


@pytest.fixture(scope="module")
def world(robot_xml: str, known_params: Params) -> World:
    return World(robot_xml, known_params.env.model_copy(update={"max_episode_steps": STEPS}))


def begin(world: World, **levels: float) -> Simulation:
    return Simulation(world, POLICY, content.start(world, START), levels)


@pytest.mark.parametrize("condition", [*CONDITIONS, NOISY], ids=lambda own: own.perturbation)
def test_an_episode_is_that_of_the_robustness_stage(world: World, condition: Condition) -> None:
    envs = PerturbedVectorEnv(world, [(condition, START)])
    POLICY.start([START])
    steps = rollout.steps(envs, envs.begin(), POLICY.act, POLICY.actions.hold)
    rewards = [step.rewards[0] for step in steps]
    own = begin(world, **({} if condition == NONE else {condition.perturbation: condition.level}))
    while not own.has_ended:
        own.step()
    first, *reports = own.frame()["reports"]
    assert first["time"] == 0 and reports[-1]["time"] == pytest.approx(STEPS * world.dt)
    assert [report["reward"] for report in reports] == rewards
    np.testing.assert_array_equal(own.data.qpos, envs.qpos[0])


def test_sliders_that_go_back_leave_nothing(world: World) -> None:
    own, other = begin(world, gravity=1.5, damping=2.0), begin(world)
    own.perturb({"slope": 10.0, "torso_mass": 1.0})
    own.perturb({})
    for _ in range(STEPS):
        own.step()
        other.step()
    np.testing.assert_array_equal(own.data.qpos, other.data.qpos)


def test_a_torso_is_pulled_and_pushed(world: World) -> None:
    pulled, pushed, other = begin(world), begin(world), begin(world)
    pulled.target = np.array([0.0, 0.0, 3.0])
    pushed.shove(np.array([40.0, 0.0, 0.0]))
    for own in (pulled, pushed, other):
        for _ in range(20):
            own.step()
    assert pulled.data.qpos[2] > 2.0 > other.data.qpos[2]
    assert pushed.data.qpos[0] > other.data.qpos[0] + 0.2
    assert not pushed.data.xfrc_applied.any(), "for a moment"


def test_what_falls_apart_is_told_in_finite_numbers(world: World) -> None:
    own = begin(world)
    own.data.qvel[:] = np.nan
    own.step()
    assert own.has_ended and own.total == 0.0
    json.dumps(own.frame(), allow_nan=False)
