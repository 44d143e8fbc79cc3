"""Plans through the true simulator."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from jumping_ant.actions import ActionSet
from jumping_ant.base.files import PROJECT_ROOT, read_json
from jumping_ant.experiment import presets
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


def test_shares_are_of_the_way_from_the_metronome_to_the_plan() -> None:
    """With DQN, whose commands have half the torque, between the metronome and plans like it."""
    agents = read_json(PROJECT_ROOT / "results" / "families.json", "")["agents"]
    means = {name: own["return"]["mean"] for name, own in agents.items()}
    least, most = means["metronome-full"], 2 * means["sac"] - means["metronome-full"]
    plans = {"torques": {"returns": [most - 1, most + 1]}, "commands": {"returns": [10_000.0]}}
    lines = ceiling.shares(presets.load("families"), plans).splitlines()
    shares = {line.split(" | ")[0].strip("| "): line.split(" | ")[-1] for line in lines[2:]}
    assert shares["sac"] == "50 % |" and "random" not in shares
    dqn = (means["dqn"] - means["metronome"]) / (10_000 - means["metronome"])
    assert shares["dqn"] == f"{round(100 * dqn)} % |"
    assert f"| sac | {means['sac']:,.0f} | {least:,.0f} | {most:,.0f} | 50 % |" in lines
