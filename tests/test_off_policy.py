import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

from jumping_ant import params_file
from jumping_ant.agents.off_policy.trainer import make_envs, make_model, train
from jumping_ant.archive import unpack
from jumping_ant.env import DiscreteCommands, JumpingAnt
from jumping_ant.events import Finished, Progress, Snapshot

PARAMS = params_file.load()
ENV = PARAMS.env.model_copy(update={"max_episode_steps": 40})  # several resets
SMALL = {
    "total_steps": 240,
    "num_envs": 1,
    "learning_starts": 50,
    "batch_size": 16,
    "net_arch": [16],
    "gradient_steps": 1,
    "log_interval": 40,
    "buffer_size": 1000,
}


def small(name: str, **changes: object):
    return PARAMS.agents[name].model_copy(update=SMALL | changes)


def trained_weights(events: list) -> bytes:
    return unpack(events[-1].policy)["policy.pth"]


@pytest.mark.parametrize("name", ["dqn", "sac"])
def test_the_loop_gives_the_weights_of_learn(robot_xml: str, name: str) -> None:
    """Against SB3 as anyone would call it: its own `learn`, on Gymnasium's single environment."""
    agent = small(name)

    def single() -> gym.Env:
        env: gym.Env = gym.wrappers.DtypeObservation(JumpingAnt(robot_xml, ENV), np.float32)
        return Monitor(DiscreteCommands(env) if name == "dqn" else env)

    torch.set_num_threads(1)
    reference = make_model(DummyVecEnv([single]), agent, seed=3)
    reference.learn(agent.total_steps)

    events = list(train(robot_xml, ENV, agent, seed=3, evaluations=2))
    ours = make_model(make_envs(robot_xml, ENV, agent), agent, seed=4)
    ours.policy.load_state_dict(read_weights(events[-1].policy))
    for theirs, mine in zip(reference.policy.parameters(), ours.policy.parameters(), strict=True):
        assert torch.equal(theirs, mine)


def read_weights(policy: bytes) -> dict:
    import io

    return torch.load(io.BytesIO(unpack(policy)["policy.pth"]), weights_only=True)


@pytest.mark.parametrize("name", ["dqn", "sac"])
def test_the_seed_alone_determines_the_policy(robot_xml: str, name: str) -> None:
    agent = small(name, num_envs=4)
    runs = [list(train(robot_xml, ENV, agent, seed, evaluations=2)) for seed in (1, 1, 2)]
    assert runs[0][-1].policy == runs[1][-1].policy
    assert trained_weights(runs[0]) != trained_weights(runs[2])


@pytest.mark.parametrize("name", ["dqn", "sac"])
def test_events_tell_the_run(robot_xml: str, name: str) -> None:
    agent = small(name, num_envs=2, gradient_steps=2)
    events = list(train(robot_xml, ENV, agent, seed=0, evaluations=3))
    rows = [event for event in events if isinstance(event, Progress)]
    assert [row.env_steps for row in rows] == [40, 80, 120, 160, 200, 240]
    assert [event.env_steps for event in events if isinstance(event, Snapshot)] == [80, 160, 240]
    assert isinstance(events[-1], Finished)
    assert rows[-1].updates == agent.total_steps - agent.learning_starts
    assert rows[-1].episodes >= 2 * (agent.total_steps // 2 // ENV.max_episode_steps)
    assert all(set(row.extra) == set(rows[0].extra) for row in rows)
    assert np.isfinite(list(rows[-1].extra.values())).all()


def test_truncation_is_not_taken_for_an_end(robot_xml: str) -> None:
    envs = make_envs(robot_xml, ENV, small("sac", num_envs=2))
    envs.reset()
    for _ in range(ENV.max_episode_steps):
        observations, _, dones, infos = envs.step(np.zeros((2, 8), np.float32))
    assert dones.all()
    for index, info in enumerate(infos):
        assert info["TimeLimit.truncated"]
        assert info["episode"]["l"] == ENV.max_episode_steps
        assert not np.array_equal(info["terminal_observation"], observations[index])
