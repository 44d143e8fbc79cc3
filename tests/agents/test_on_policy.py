"""On-policy algorithms: Stable-Baselines3's own loop, with what this project adds to it."""

import io
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import small_agents
import torch
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

from jumping_ant.actions import ActionSet
from jumping_ant.agents.events import Progress, Snapshot
from jumping_ant.agents.job import Job
from jumping_ant.agents.on_policy.trainer import train
from jumping_ant.agents.sb3.model import make_envs, make_model
from jumping_ant.base.seeding import derive
from jumping_ant.params.blocks import ActionParams
from jumping_ant.policies import policy_file
from jumping_ant.sim.env import RobotEnv
from jumping_ant.sim.world import World

ENV = small_agents.PARAMS.env.model_copy(update={"max_episode_steps": 60})
NAMES = small_agents.of_package("on_policy")
KINDS = ("torques", "commands", "levels")


def small(name: str, kind: str, hold: int = 2) -> Any:
    agent = small_agents.agents()[name]
    actions = ActionParams(
        kind=kind, levels=2 if kind == "levels" else None, amplitude=1.0, hold=hold
    )
    alone = {"num_envs": 1, "long_episodes": 0.0, "tumbled_starts": 0.0, "episode_steps": 40}
    return agent.model_copy(update={"actions": actions, "n_steps": 20} | alone)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", NAMES)
def test_the_loop_gives_the_weights_of_learn(robot_xml: str, name: str, kind: str) -> None:
    """Against SB3 as anyone would call it: its own `learn`, on Gymnasium's single environment."""
    agent = small(name, kind)

    def single() -> gym.Env:
        task = ENV.model_copy(update={"max_episode_steps": agent.episode_steps})
        actions = ActionSet.of(agent.actions, task.commands)
        env = RobotEnv(World(robot_xml, task), actions=actions)
        return Monitor(gym.wrappers.DtypeObservation(env, np.float32))

    torch.set_num_threads(1)
    envs = DummyVecEnv([single])
    reference = make_model(envs, agent, seed=3)
    envs.seed(derive(3, "starts"))
    reference.learn(agent.total_steps // agent.actions.hold)

    events = list(train(Job(World(robot_xml, ENV), agent, seed=3, evaluations=2)))
    assert [event.env_steps for event in events if isinstance(event, Snapshot)] == [120, 240]
    ours = policy_file.parse(events[-1].policy)
    theirs = [reference.policy.mlp_extractor.policy_net[0], reference.policy.action_net]
    for layer, (weight, bias) in zip(theirs, ours.layers, strict=True):
        assert np.array_equal(layer.weight.detach().numpy(), weight)
        assert np.array_equal(layer.bias.detach().numpy(), bias)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", NAMES)
def test_policies_act_as_in_stable_baselines3(robot_xml: str, name: str, kind: str) -> None:
    agent = small(name, kind)
    job = Job(World(robot_xml, ENV), agent, seed=1)
    events = list(train(job))
    policy = policy_file.parse(events[-1].policy)
    model = make_model(make_envs(Job(World(robot_xml, ENV), agent, seed=9)), agent, seed=9)
    model.set_parameters(type(model).load(io.BytesIO(events[-1].policy)).get_parameters())
    observations = np.random.default_rng(0).normal(0, 3, (50, 27)).astype(np.float32)
    choices, _ = model.predict(observations, deterministic=True)
    torques = ActionSet.of(agent.actions, ENV.commands).torques(choices)
    np.testing.assert_allclose(policy.act(observations), torques, rtol=0, atol=1e-5)
    assert len(np.unique(torques, axis=0)) > 1


@pytest.mark.parametrize("name", NAMES)
def test_rows_are_in_control_steps(robot_xml: str, name: str) -> None:
    events = list(train(Job(World(robot_xml, ENV), small_agents.agents()[name], seed=0)))
    rows = [event for event in events if isinstance(event, Progress)]
    hold = small_agents.agents()[name].actions.hold
    assert [row.env_steps for row in rows] == [40 * hold, 80 * hold]
    assert rows[-1].updates > rows[0].updates > 0
