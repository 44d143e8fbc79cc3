"""Plans through the true simulator."""

import sys
from pathlib import Path

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from jumping_ant.actions import ActionSet
from jumping_ant.base.files import read_json
from jumping_ant.experiment import params_file
from jumping_ant.experiment.models import Params
from jumping_ant.policies.blind import OpenLoopPolicy, UniformPolicy
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import rollout
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World
from scripts import ceiling

STEPS, START = 48, 7_000_900


@pytest.fixture
def world(robot_xml: str, known_params: Params, monkeypatch: pytest.MonkeyPatch) -> World:
    monkeypatch.setattr(ceiling, "SAMPLES", 16)
    monkeypatch.setattr(ceiling, "HORIZON", 6)
    return World(robot_xml, known_params.env.model_copy(update={"max_episode_steps": STEPS}))


def action_set(name: str, world: World) -> ActionSet:
    return ActionSet.of(ceiling.ACTIONS[name], world.env.commands)


@pytest.mark.parametrize("name", ceiling.ACTIONS)
def test_plans_return_more_than_what_does_not_plan(world: World, name: str) -> None:
    actions = action_set(name, world)
    blind: list[Policy] = [UniformPolicy(seed, actions, 8) for seed in range(3)]
    amplitude = ceiling.ACTIONS[name].amplitude
    table = amplitude * np.array(world.env.commands, np.float32)[[3, 4]]
    blind += [OpenLoopPolicy(ActionSet(table, hold=hold)) for hold in (2, 3, 4, 5)]
    returns = [rollout.run(world, policy, [START])[0].rewards.sum() for policy in blind]
    planned = ceiling.plan(world, actions, START)
    assert planned > max(returns)
    assert planned == ceiling.plan(world, actions, START)


def test_a_plan_returns_what_the_planner_expects(world: World) -> None:
    """From a state in the middle of an episode, to the last bit."""
    actions = action_set("torques", world)
    planner = ceiling.Planner(world, actions, np.random.default_rng(0))
    env = RobotVectorEnv(world, 1, 1, AutoresetMode.DISABLED, actions)
    env.reset(seed=[START])
    for _ in range(3):
        env.step(planner.decide(env.save_state())[None])
    plans = planner._draw(ceiling.SAMPLES)
    expected = planner._play(plans, env.save_state())
    state = env.save_state()
    for number in (0, 7):
        env.load_state(state)
        played = sum(env.step(choice[None])[1][0] for choice in plans[number])
        assert played == expected[number]


def test_starts_are_the_first_of_the_first_seeds(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is not asked for, stays."""
    params = params_file.load()
    monkeypatch.setattr(ceiling, "PATH", tmp_path / "ceiling.json")
    monkeypatch.setattr(
        ceiling.params_file, "load", lambda: params.model_copy(update={"env": world.env})
    )
    for names in (["commands"], ["torques"]):
        monkeypatch.setattr(sys, "argv", ["ceiling", "--starts", "2", "--actions", *names])
        ceiling.main()
    plans = read_json(ceiling.PATH, "")
    assert plans.keys() == {"commands", "torques"}
    starts = [params.evaluate.block(seed)[0] for seed in params.seeds[:2]]
    assert [own["starts"] for own in plans.values()] == [starts, starts]
    assert all(len(own["returns"]) == 2 and own["seconds"] > 0 for own in plans.values())


def test_shares_are_of_the_way_from_the_metronome_to_the_plan() -> None:
    """With DQN, whose commands have half the torque, between the metronome and plans like it."""
    means = {"random": 500, "metronome": 4000, "metronome-full": 6000, "dqn": 5500, "sac": 7000}
    agents = {name: {"return": {"mean": mean}} for name, mean in means.items()}
    plans = {"torques": {"returns": [7999, 8001]}, "commands": {"returns": [10_000.0]}}
    lines = ceiling.shares(params_file.load(), agents, plans).splitlines()
    assert lines[2:] == [
        "| sac | 7,000 | 6,000 | 8,000 | 50 % |",
        "| dqn | 5,500 | 4,000 | 10,000 | 25 % |",
    ]
