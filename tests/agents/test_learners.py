"""Against Stable-Baselines3's own classes, from the same state and with the same random numbers."""

import copy
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces
from stable_baselines3 import DQN, SAC
from stable_baselines3.common.buffers import NStepReplayBuffer, ReplayBuffer
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.agents.job import Job
from jumping_ant.agents.off_policy.lean.adam import FlatAdam, denormals_flushed
from jumping_ant.agents.off_policy.lean.replay import BatchedReplayBuffer
from jumping_ant.agents.sb3 import trainer
from jumping_ant.agents.sb3.model import make_envs
from jumping_ant.params import presets
from jumping_ant.params.blocks import LevelParams
from jumping_ant.sim.world import World

PARAMS = presets.load("families")
ENV = PARAMS.env.model_copy(update={"max_episode_steps": 45})


def filled_model(xml: str, name: str, **changes: object) -> OffPolicyAlgorithm:
    """Return a model whose buffer is filled by random actions, not yet trained."""
    small = {"num_envs": 4, "learning_starts": 10**6, "batch_size": 64, "net_arch": [48, 32]}
    small |= {"episode_steps": 30, "long_episodes": 0.5}  # the buffer holds ends of episodes
    agent = PARAMS.agents[name].model_copy(update=small | changes)
    model = trainer.make_model(make_envs(Job(World(xml, ENV), agent, seed=0)), agent, seed=0)
    model.set_logger(Logger(folder=None, output_formats=[]))
    model.learn(400)
    return model


def weights(model: OffPolicyAlgorithm) -> torch.Tensor:
    return torch.cat([parameter.detach().flatten() for parameter in model.policy.parameters()])


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("dqn", {"n_steps": 1, "max_grad_norm": 0.5}),
        ("dqn", {"n_steps": 4}),
        ("sac", {"n_steps": 1, "ent_coef": 0.05}),
        ("sac", {"n_steps": 3, "ent_coef": "auto"}),
    ],
)
def test_updates_are_those_of_sb3(
    robot_xml: str, monkeypatch: pytest.MonkeyPatch, name: str, changes: dict
) -> None:
    lean = filled_model(robot_xml, name, **changes)
    with monkeypatch.context() as patch:
        stock = replace(ALGORITHMS[name], learner=f"stable_baselines3:{name.upper()}")
        patch.setitem(ALGORITHMS, name, stock)
        reference = filled_model(robot_xml, name, **changes)
    assert type(reference) in (DQN, SAC) and type(lean) not in (DQN, SAC)
    start = weights(lean)
    assert torch.equal(start, weights(reference))

    for gradient_steps in (1, 4, 25):
        for model in (lean, reference):
            torch.manual_seed(1)
            np.random.seed(1)
            model.train(gradient_steps, batch_size=64)
    moved = (weights(reference) - start).norm()
    assert moved > 0.01
    assert (weights(lean) - weights(reference)).norm() < 1e-3 * moved
    theirs = reference.logger.name_to_value
    assert {key for key in theirs if key != "train/ent_coef_loss"} == set(lean.logger.name_to_value)
    for key, value in lean.logger.name_to_value.items():
        assert value == pytest.approx(theirs[key], rel=1e-3), key


@pytest.mark.parametrize("levels", [2, 3])
def test_the_value_of_levels_is_the_mean_over_the_motors(robot_xml: str, levels: int) -> None:
    """Seyde et al. 2023: equations 2 and 3, by autograd on SB3's own network and batches."""
    actions = LevelParams(kind="levels", levels=levels, amplitude=1.0, hold=3)  # type: ignore[arg-type]
    ours = filled_model(robot_xml, "decqn", actions=actions, n_steps=2, final_learning_rate=None)
    network, target = copy.deepcopy(ours.q_net), copy.deepcopy(ours.q_net_target)
    for weight in target.parameters():
        weight.data += 0.05 * torch.randn_like(weight)
    ours.q_net_target.load_state_dict(target.state_dict())
    optimizer = torch.optim.Adam(network.parameters(), lr=ours.lr_schedule(1.0))
    start = weights(ours)
    np.random.seed(1)
    ours.train(gradient_steps=5, batch_size=64)
    np.random.seed(1)
    for batch in ours.replay_buffer.draw(5, 64).split(64):
        values, following = (
            [head(seen)[:, levels * motor :][:, :levels] for motor in range(8)]
            for head, seen in ((network, batch.observations), (target, batch.next_observations))
        )
        best = torch.stack([own.max(dim=1).values for own in following]).mean(dim=0)
        chosen = [own[range(64), batch.actions[:, motor]] for motor, own in enumerate(values)]
        goal = batch.rewards[:, 0] + batch.discounts[:, 0] * best.detach()
        loss = torch.nn.functional.smooth_l1_loss(torch.stack(chosen).mean(dim=0), goal)
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), ours.max_grad_norm)
        optimizer.step()
    theirs = torch.cat([weight.detach().flatten() for weight in network.parameters()])
    mine = weights(ours)[: len(theirs)]
    moved = (theirs - start[: len(theirs)]).norm()
    assert moved > 0.01 and (mine - theirs).norm() < 1e-3 * moved


@pytest.mark.parametrize("epsilon", [0.0, 0.5, 1.0])
def test_one_environment_explores_as_in_sb3(robot_xml: str, epsilon: float) -> None:
    model = filled_model(robot_xml, "dqn", num_envs=1)
    model.exploration_rate = epsilon
    observations = np.random.default_rng(0).normal(0, 1, (100, 1, 27)).astype(np.float32)
    choices = []
    for predict in (model.predict, partial(DQN.predict, model)):
        np.random.seed(3)
        model.action_space.seed(4)
        choices.append([predict(observation)[0].tolist() for observation in observations])
        choices[-1].append([np.random.rand()])  # as many coins were tossed
    assert choices[0] == choices[1]
    greedy = [model.predict(observation, deterministic=True)[0] for observation in observations]
    others = np.mean(np.array(choices[0][:-1]) != greedy)
    assert others == pytest.approx(0.8 * epsilon, abs=0.15), "one of five is the greedy one"


@pytest.mark.parametrize(("name", "others"), [("dqn", 0.4), ("decqn", 0.25)])
def test_each_environment_and_each_motor_explores_alone(
    robot_xml: str, name: str, others: float
) -> None:
    """SB3 decides once for all: either every environment explores or none does."""
    model = filled_model(robot_xml, name, num_envs=4)
    model.exploration_rate = 0.5
    observation = np.random.default_rng(0).normal(0, 1, (4, 27)).astype(np.float32)
    greedy = model.predict(observation, deterministic=True)[0]

    def correlation(predict: Callable[..., Any]) -> float:
        np.random.seed(3)
        model.action_space.seed(4)
        explored = np.array([predict(observation)[0] != greedy for _ in range(1000)])
        np.testing.assert_allclose(explored.mean(axis=0), others, atol=0.07)
        return float(
            np.corrcoef(explored.reshape(1000, -1).T)[np.triu_indices(greedy.size, 1)].mean()
        )

    assert abs(correlation(model.predict)) < 0.05
    if name == "dqn":
        assert correlation(partial(DQN.predict, model)) > 0.5


@pytest.mark.parametrize("n_steps", [1, 3])
@pytest.mark.parametrize("num_added", [50, 130])  # before and after the buffer of 80 rows is full
def test_batches_are_those_of_sb3(n_steps: int, num_added: int) -> None:
    generator = np.random.default_rng(0)
    spaces_ = (spaces.Box(-1, 1, (5,), np.float32), spaces.Box(-1, 1, (2,), np.float32))
    ours = BatchedReplayBuffer(240, *spaces_, "cpu", 3, n_steps=n_steps, gamma=0.9)
    if n_steps == 1:
        theirs: ReplayBuffer = ReplayBuffer(240, *spaces_, "cpu", 3)
    else:
        theirs = NStepReplayBuffer(240, *spaces_, "cpu", 3, n_steps=n_steps, gamma=0.9)
    for _ in range(num_added):
        observations = generator.normal(size=(2, 3, 5)).astype(np.float32)
        actions = generator.uniform(-1, 1, (3, 2)).astype(np.float32)
        rewards, dones = generator.normal(size=3), generator.random(3) < 0.1
        infos = [{"TimeLimit.truncated": bool(done and generator.random() < 0.5)} for done in dones]
        for buffer in (ours, theirs):
            buffer.add(*observations, actions, rewards, dones, infos)

    np.random.seed(5)
    batches = list(ours.draw(3, 200).split(200))
    np.random.seed(5)
    for batch in batches:
        sample = theirs.sample(200)
        assert torch.equal(batch.observations, sample.observations)
        assert torch.equal(batch.actions, sample.actions)
        assert torch.equal(batch.rewards, sample.rewards)
        assert torch.equal(batch.next_observations, sample.next_observations)
        discounts = 0.9 if sample.discounts is None else sample.discounts
        assert torch.equal(batch.discounts, (1 - sample.dones) * discounts)
    assert len(batches) == 3


def test_means_of_silent_neurons_vanish() -> None:
    """Left alone they stay denormal, the smallest numbers there are, and cost a hundredfold."""
    torch.set_num_threads(1)  # as in the pipeline; others would keep their denormals
    tiny = torch.finfo(torch.float32).tiny
    network = torch.nn.Linear(8, 8)
    optimizer = torch.optim.Adam(network.parameters())
    adam = FlatAdam(optimizer)
    adam.gradient.fill_(1.0)
    with torch.no_grad(), denormals_flushed():
        adam.step()
        adam.gradient.zero_()
        for _ in range(1200):
            adam.step()
    assert optimizer.state[network.weight]["exp_avg"].abs().max() == 0
    assert torch.tensor(tiny) / 2 > 0, "denormals are back afterwards"
