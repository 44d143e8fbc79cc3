"""Stable-Baselines3's loop, with what this project adds to it."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import small_agents
import torch
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

from jumping_ant.agents.events import Finished, Progress, Snapshot
from jumping_ant.agents.job import Job
from jumping_ant.agents.sb3.model import make_envs, make_model
from jumping_ant.agents.sb3.trainer import train
from jumping_ant.base.archive import Archive
from jumping_ant.base.seeding import derive
from jumping_ant.params.blocks import ActionParams
from jumping_ant.policies import tensors
from jumping_ant.policies.actions import ActionSet
from jumping_ant.sim.env import RobotEnv
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World

PARAMS = small_agents.PARAMS
OFF_POLICY, ON_POLICY = map(small_agents.of_package, ("off_policy", "on_policy"))
ENV = PARAMS.env.model_copy(update={"max_episode_steps": 60})
SMALLER = {
    **{"num_envs": 1, "gradient_steps": 1, "buffer_size": 1000},
    **{"episode_steps": 40, "long_episodes": 0.0, "tumbled_starts": 0.0},  # several resets
}


def small(name: str, hold: int = 2, kind: str = "", **changes: object) -> Any:
    agent: Any = small_agents.agents()[name]
    actions = agent.actions.model_copy(update={"hold": hold})
    if kind:
        levels = 2 if kind == "levels" else None
        actions = ActionParams(kind=kind, levels=levels, amplitude=1.0, hold=hold)
    sizes = SMALLER | ({"n_steps": 20} if name in ON_POLICY else {})
    fitting = {key: value for key, value in sizes.items() if key in type(agent).model_fields}
    return agent.model_copy(update=fitting | {"actions": actions} | changes)


@pytest.mark.parametrize(
    ("name", "kind", "hold"),
    [(name, "", hold) for name in OFF_POLICY for hold in (1, 3)]
    + [(name, kind, 2) for name in ON_POLICY for kind in ("torques", "commands", "levels")],
)
def test_the_loop_gives_the_weights_of_learn(
    robot_xml: str, name: str, kind: str, hold: int
) -> None:
    """Against SB3 as anyone would call it: its own `learn`, on Gymnasium's single environment."""
    agent = small(name, hold, kind)

    def single() -> gym.Env:
        task = ENV.model_copy(update={"max_episode_steps": agent.episode_steps})
        actions = ActionSet.of(agent.actions, task.commands)
        env = RobotEnv(World(robot_xml, task), actions=actions)
        env.task = env.envs.task  # by which the model's networks are sized
        return Monitor(gym.wrappers.DtypeObservation(env, np.float32))

    torch.set_num_threads(1)
    envs = DummyVecEnv([single])
    reference = make_model(envs, agent, seed=3)
    envs.seed(derive(3, "starts"))
    reference.learn(agent.total_steps // hold)

    events = list(train(Job(World(robot_xml, ENV), agent, seed=3, evaluations=2)))
    ours = tensors.read(Archive(events[-1].policy)["policy.pth"])
    theirs = reference.policy.state_dict()
    assert ours.keys() == theirs.keys()
    assert all(np.array_equal(ours[key], theirs[key].numpy()) for key in ours)


@pytest.mark.parametrize("hold", [1, 3])
@pytest.mark.parametrize("name", OFF_POLICY)
def test_events_tell_the_run(robot_xml: str, name: str, hold: int) -> None:
    """In control steps, however long a decision lasts; rows and updates go by decisions."""
    agent = small(name, hold, num_envs=2, gradient_steps=2)
    events = list(train(Job(World(robot_xml, ENV), agent, seed=0, evaluations=3)))
    rows = [event for event in events if isinstance(event, Progress)]
    evaluated = [80, 160, 240]
    logged = range(agent.log_interval * hold, 241, agent.log_interval * hold)
    # A row is written with each evaluation, too: a decision of three steps may pass the mark.
    assert {row.env_steps for row in rows} >= set(logged)
    snapshots = [event.env_steps for event in events if isinstance(event, Snapshot)]
    assert all(0 <= at - due < 2 * hold for at, due in zip(snapshots, evaluated, strict=True))
    assert {row.env_steps for row in rows} == set(logged) | set(snapshots)
    assert isinstance(events[-1], Finished) and events[-1].env_steps == 240
    assert rows[-1].updates == agent.total_steps // hold - agent.learning_starts
    longest = -(-agent.episode_steps // hold)  # decisions of an episode
    assert rows[-1].episodes >= 2 * (agent.total_steps // hold // 2 // longest) > 2


def test_every_episode_of_a_round_counts(robot_xml: str) -> None:
    """SB3 itself keeps a hundred of them."""
    agent = small("ppo", hold=1, num_envs=64, n_steps=20, episode_steps=4, total_steps=2560)
    events = list(train(Job(World(robot_xml, ENV), agent, seed=0, evaluations=2)))
    rows = [event for event in events if isinstance(event, Progress)]
    assert [row.episodes for row in rows] == [320, 640]


def test_control_steps_after_a_fall_are_not_counted(
    robot_xml: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Decisions are, which the budget consists of."""
    counted, step = [], RobotVectorEnv._control_step

    def count(envs: RobotVectorEnv, torques: Any, resting: Any) -> Any:
        counted.append(np.count_nonzero(~resting))
        return step(envs, torques, resting)

    monkeypatch.setattr(RobotVectorEnv, "_control_step", count)
    task = ENV.model_copy(update={"max_torso_height": 0.8, "min_torso_height": 0.5})
    agent = small("sac", hold=3, num_envs=2, total_steps=240, episode_steps=39, log_interval=1)
    events = list(train(Job(World(robot_xml, task), agent, seed=1, evaluations=1)))
    rows = [event for event in events if isinstance(event, Progress)]
    assert rows[-1].env_steps == events[-1].env_steps == sum(counted) < 240
    assert rows[-1].updates == (80 - agent.learning_starts) // 2


def test_truncation_is_not_taken_for_an_end(robot_xml: str) -> None:
    agent = small("sac", hold=2, num_envs=2)
    envs = make_envs(Job(World(robot_xml, ENV), agent, seed=0))
    envs.reset()
    for _ in range(agent.episode_steps // 2):
        observations, _, dones, infos = envs.step(np.zeros((2, 8), np.float32))
    assert dones.all()
    for index, info in enumerate(infos):
        assert info["TimeLimit.truncated"]
        assert not np.array_equal(info["terminal_observation"], observations[index])


def test_sparse_rewards_come_at_the_end_of_an_episode(robot_xml: str) -> None:
    """All of them: the returns are the same, and so is what the robot does."""
    runs = []
    for sparse in (False, True):
        agent = small("sac", hold=2, num_envs=2, sparse_rewards=sparse)
        envs = make_envs(Job(World(robot_xml, ENV), agent, seed=0))
        envs.reset()
        actions = np.random.default_rng(0).uniform(-1, 1, (40, 2, 8)).astype(np.float32)
        runs.append(
            [np.array(part) for part in zip(*(envs.step(a)[:3] for a in actions), strict=True)]
        )
    (observations, rewards, dones), (same, sparse_rewards, same_dones) = runs
    assert np.array_equal(observations, same) and np.array_equal(dones, same_dones)
    assert dones.sum() > 2
    for index in range(2):
        start = 0
        for end in np.flatnonzero(dones[:, index]) + 1:
            episode = slice(start, end), index
            assert sparse_rewards[episode][:-1].tolist() == [0.0] * (end - start - 1)
            assert sparse_rewards[episode][-1] == pytest.approx(rewards[episode].sum(), rel=1e-5)
            start = end


@pytest.mark.parametrize(("share", "num_long"), [(0.0, 0), (0.25, 2), (0.5, 4), (1.0, 8)])
@pytest.mark.parametrize("short", [4, None])
def test_a_share_of_the_environments_has_long_episodes(
    robot_xml: str, share: float, num_long: int, short: int | None
) -> None:
    """Long is as the task says; null cuts no episode. Nothing falls below this floor."""
    env = PARAMS.env.model_copy(update={"max_episode_steps": 10, "min_torso_height": -1.0})
    agent = small("sac", hold=1, num_envs=8, long_episodes=share, episode_steps=short)
    envs = make_envs(Job(World(robot_xml, env), agent, seed=0))
    envs.reset()
    cut = [envs.step(np.zeros((8, 8), np.float32))[2] for _ in range(40)]
    ends = [(np.flatnonzero(column) + 1).tolist() for column in np.transpose(cut)]
    long = [10, 20, 30, 40]
    others = [] if short is None else list(range(4, 41, 4))
    assert ends == [long] * num_long + [others] * (8 - num_long)
