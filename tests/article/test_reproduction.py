"""The article's tests of trained agents: exploring policies that play on, and printed values."""

from typing import Any

import numpy as np
import pytest
import torch
from evotorch.neuroevolution import GymNE

from jumping_ant.actions import ActionSet
from jumping_ant.agents.job import Job
from jumping_ant.agents.off_policy.trainer import make_model
from jumping_ant.agents.sb3.model import make_envs, policy_bytes
from jumping_ant.article import reproduction
from jumping_ant.article.reproduction import Trace, percentile_among, place, play
from jumping_ant.experiment import params_file
from jumping_ant.params import article
from jumping_ant.policies import policy_file
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.sim import robot
from jumping_ant.sim.env import RobotEnv
from jumping_ant.sim.world import World

XML = robot.build(article.ROBOT)
OBSERVATIONS = np.random.default_rng(0).normal(0, 3, (20, 27))


def test_percentiles_by_hand() -> None:
    ours = np.array([1.0, 2.0, 2.0, 5.0])
    assert percentile_among(0.0, ours) == 0
    assert percentile_among(2.0, ours) == 50  # one below, two as large
    assert percentile_among(3.0, ours) == 75
    assert percentile_among(9.0, ours) == 100


@pytest.mark.parametrize(
    ("value", "reproduced"), [(-0.5, False), (0.0, True), (3.3, True), (7.0, True), (7.5, False)]
)
def test_a_value_is_reproduced_within_eight_seeds(value: float, reproduced: bool) -> None:
    placed = place(value, np.arange(8.0)[::-1])
    assert placed["reproduced"] is reproduced
    assert (placed["low"], placed["median"], placed["high"]) == (0, 3.5, 7)
    assert placed["ours"] == [7, 6, 5, 4, 3, 2, 1, 0]


def test_the_central_values_of_many_seeds_leave_the_outer_ones_out() -> None:
    ours = np.arange(1000.0)
    assert (place(0.0, ours)["low"], place(0.0, ours)["high"]) == (25, 974)
    inside = [place(value, ours)["reproduced"] for value in (20.0, 30.0, 970.0, 980.0)]
    assert inside == [False, True, True, False]


def test_seven_seeds_decide_nothing() -> None:
    assert place(3.0, np.arange(7.0))["reproduced"] is None


def test_printed_points_meet_the_same_steps_of_ours() -> None:
    trace = Trace({1: 5.0, 3: 20.0}, np.array([[1.0, 2.0, 3.0], [10.0, 20.0, 30.0]]))
    places = trace.places()
    assert [point["at"] for point in places] == [1, 3]
    assert [point["ours"] for point in places] == [[1, 10], [3, 30]]
    assert trace.last()["value"] == 20
    assert trace.last()["ours"] == [3, 30]


def test_a_test_goes_on_where_an_episode_would_have_ended() -> None:
    """The rewards are those of a plain loop over the single environment that ignores the ends."""
    task = article.ENV.model_copy(update={"min_torso_height": 0.6, "max_episode_steps": 50})
    env = RobotEnv(World(XML, task))
    observation, _ = env.reset(seed=7)
    rng = np.random.default_rng(1)
    rewards, ends = [], []
    for _ in range(150):
        observation, reward, terminated, truncated, _ = env.step(rng.uniform(-1, 1, 8))
        rewards.append(reward)
        ends.append(terminated or truncated)
    assert any(ends[:100]) and sum(rewards[100:]) > 0

    rng = np.random.default_rng(1)
    ours = play(World(XML, task), lambda seen: rng.uniform(-1, 1, (1, 8)), 1, seed=7, num_steps=150)
    np.testing.assert_array_equal(ours, rewards)


def test_choices_are_held_and_follow_what_is_observed() -> None:
    seen: list[np.ndarray] = []

    def act(observations: np.ndarray) -> np.ndarray:
        seen.append(observations)
        return np.full((1, 8), 0.5)

    play(World(XML, article.ENV), act, 3, seed=0, num_steps=10)
    assert len(seen) == 4
    env = RobotEnv(World(XML, article.ENV))
    observation, _ = env.reset(seed=0)
    np.testing.assert_array_equal(seen[0], observation[None])
    for _ in range(3):
        observation, *_ = env.step(np.full(8, 0.5))
    np.testing.assert_array_equal(seen[1], observation[None])


def test_a_state_that_is_not_finite_earns_nothing_any_more() -> None:
    xml = robot.build(article.ROBOT.model_copy(update={"gear": 1e12}))
    torques = iter(np.repeat([0.0, 1.0], [5, 55]))
    rewards = play(
        World(xml, article.ENV), lambda _: np.full((1, 8), next(torques)), 1, seed=0, num_steps=60
    )
    assert (rewards[:3] > 0).all()
    assert (rewards[8:] == 0).all()


def network(algorithm: str) -> tuple[Any, Any]:
    """Return an untrained model of Stable-Baselines3 and the policy of its file."""
    update = {"net_arch": [16, 8], "buffer_size": 10, "num_envs": 1, "velocity_scale": 0.3}
    agent: Any = params_file.load().agents[algorithm].model_copy(update=update)
    model = make_model(make_envs(Job(World(XML, article.ENV), agent, seed=5)), agent, seed=5)
    if algorithm == "sac":
        with torch.no_grad():  # an untrained layer hardly varies, and clips nothing
            model.actor.log_std.weight.mul_(12.0)
            model.actor.log_std.bias.sub_(0.5)
    actions = ActionSet.of(agent.actions, article.ENV.commands)
    return model, policy_file.parse(policy_bytes(model, agent, actions))


def generators(count: int, seed: int = 0) -> list[np.random.Generator]:
    """Return independent generators."""
    return [np.random.default_rng([seed, index]) for index in range(count)]


def test_sac_draws_from_the_gaussian_of_stable_baselines3() -> None:
    model, policy = network("sac")
    with torch.no_grad():
        features = torch.from_numpy(OBSERVATIONS.astype(np.float32))
        mean, log_stdev, _ = model.actor.get_action_dist_params(features)
    own_mean, own_stdev = policy.gaussian(OBSERVATIONS)
    np.testing.assert_allclose(own_mean, mean.numpy(), atol=1e-5)
    np.testing.assert_allclose(own_stdev, log_stdev.exp().numpy(), rtol=1e-4)
    assert log_stdev.max() == 2.0  # the clipped range is reached


def test_sac_samples_as_stable_baselines3_predicts() -> None:
    model, policy = network("sac")
    repeated = np.repeat(OBSERVATIONS[:1], 4000, axis=0)
    ours = policy.explore(repeated, generators(4000))
    theirs, _ = model.predict(repeated.astype(np.float32))
    np.testing.assert_allclose(ours.mean(0), theirs.mean(0), atol=0.06)
    np.testing.assert_allclose(ours.std(0), theirs.std(0), atol=0.04)
    assert ours.std(0).min() > 0.1
    assert np.abs(ours).max() <= 1


def test_a_row_draws_from_its_own_generator_alone() -> None:
    _, policy = network("sac")
    together = policy.explore(OBSERVATIONS[:3], generators(3))
    alone = policy.explore(OBSERVATIONS[1:2], generators(3)[1:2])
    np.testing.assert_allclose(together[1:2], alone, rtol=1e-5)


def test_dqn_explores_with_its_epsilon() -> None:
    model, policy = network("dqn")
    repeated = np.repeat(OBSERVATIONS[:1], 6000, axis=0)
    greedy = policy.act(repeated[:1])
    np.testing.assert_array_equal(
        policy.explore(OBSERVATIONS, generators(20), epsilon=0.0), policy.act(OBSERVATIONS)
    )
    ours = policy.explore(repeated, generators(6000), epsilon=0.3)
    model.exploration_rate = 0.3
    theirs, _ = model.predict(repeated.astype(np.float32))
    table = policy.actions.table
    share = np.mean((ours == greedy).all(1))
    assert share == pytest.approx(0.7 + 0.3 / 5, abs=0.02)
    assert share == pytest.approx(np.mean((table[theirs] == greedy).all(1)), abs=0.03)
    others = [np.mean((ours == row).all(1)) for row in table if (row != greedy[0]).any()]
    np.testing.assert_allclose(others, 0.06, atol=0.015)


def linear_policy() -> LinearPolicy:
    rng = np.random.default_rng(1)
    arrays = {
        "weight": rng.normal(0, 0.1, (8, 27)),
        "bias": rng.normal(0, 0.1, 8),
        "mean": rng.normal(0, 1, 27),
        "stdev": rng.uniform(0.5, 2, 27),
        "weight_spread": np.ones((8, 27)),
        "bias_spread": np.ones(8),
    }
    return LinearPolicy(
        **{name: array.astype(np.float32) for name, array in arrays.items()}, actions=ActionSet()
    )


class SeededStart(RobotEnv):
    """Starts from a known state, as EvoTorch resets without a seed."""

    def reset(self, **_: Any) -> Any:
        return super().reset(seed=3)


def test_the_film_of_pgpe_is_that_of_a_fresh_problem() -> None:
    """EvoTorch's `visualize` is this `run`, drawn: its normaliser has seen nothing all along."""
    policy = linear_policy()
    fresh = GymNE(
        lambda: SeededStart(World(XML, article.ENV)),
        "Linear(obs_length, act_length)",
        observation_normalization=True,
        decrease_rewards_by=1,
        episode_length=40,
    )
    solution = torch.from_numpy(np.concatenate([policy.weight.ravel(), policy.bias]))
    theirs = fresh.run(fresh.to_policy(solution), num_episodes=1)
    assert theirs["interaction_count"] == 40

    def total(policy: LinearPolicy) -> float:
        return float(play(World(XML, article.ENV), policy.act, 1, seed=3, num_steps=40).sum())

    film = total(reproduction.without_normalizer(policy))
    assert film == pytest.approx(theirs["cumulative_reward"] + 40, rel=1e-3)
    assert total(policy) != pytest.approx(film, rel=0.05)
