"""The article's tests of trained agents: exploring policies that play on, and printed values."""

from typing import Any

import numpy as np
import pytest
import torch
from evotorch.neuroevolution import GymNE

from jumping_ant.agents.job import Job
from jumping_ant.agents.sb3.model import make_envs, make_model, policy_bytes
from jumping_ant.article import reproduction
from jumping_ant.article.reproduction import Trace, judge, place, play
from jumping_ant.base.seeding import derive
from jumping_ant.params import article, params_file
from jumping_ant.policies import policy_file
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.sim import robot
from jumping_ant.sim.env import RobotEnv
from jumping_ant.sim.world import World

WORLD = World(robot.build(article.ROBOT), article.ENV)
OBSERVATIONS = np.random.default_rng(0).normal(0, 3, (20, 27))


def test_single_tests_of_eight_seeds_by_hand() -> None:
    """Of single tests, the share that reach a value has Jeffreys' Beta(k + 1/2, n - k + 1/2)."""
    placed = place(7.5, np.arange(8.0)[::-1, None])
    assert placed["ours"] == [7, 6, 5, 4, 3, 2, 1, 0]
    assert (placed["low"], placed["median"], placed["high"]) == (0, 3.5, 7)
    assert placed["percentile"] == 100
    assert placed["tests"] == {"each": 1, "reached": [0] * 8}
    found = placed["probability"]
    assert (found["side"], found["value"]) == ("at or above", pytest.approx(0.5 / 9))
    assert found["p"] == pytest.approx(1 / 9)
    assert placed["reproduced"] is None


def test_the_side_further_out_counts() -> None:
    tests = np.arange(400.0).reshape(8, 50)
    low, high = judge(30.0, tests), judge(371.0, tests)
    assert low["probability"]["side"] == "at or below"
    assert low["tests"] == {"each": 50, "reached": [31, 0, 0, 0, 0, 0, 0, 0]}
    assert high["probability"]["side"] == "at or above"
    assert high["tests"]["reached"] == [0, 0, 0, 0, 0, 0, 0, 29]


NORMAL = np.random.default_rng(0).normal(size=(40, 50))


@pytest.mark.parametrize(
    ("value", "tests", "reproduced"),
    [
        *((value, NORMAL[:8], True) for value in (0.5, -1.0)),
        *((value, NORMAL, False) for value in (9.0, -9.0)),
        (9.0, NORMAL[:8], None),  # eight policies may all have been others
        (6.5, np.repeat(np.arange(8.0)[:, None], 50, axis=1), None),  # which one policy reaches
    ],
)
def test_verdicts(value: float, tests: np.ndarray, reproduced: bool | None) -> None:
    assert judge(value, tests)["reproduced"] is reproduced


@pytest.mark.parametrize(("alike", "level"), [(0.3, 0.0125), (0.9, 0.0125), (1.0, 0.05)])
def test_values_of_new_policies_are_rarely_said_not_to_be_reproduced(
    alike: float, level: float
) -> None:
    """At most in 1.25 % of cases, .05 for four values, unless all tests of a policy are alike."""
    generator = np.random.default_rng(1)
    verdicts = []
    for _ in range(300):
        policies = generator.normal(0, np.sqrt(alike), (41, 1))
        tests = policies + generator.normal(0, np.sqrt(1 - alike), (41, 50))
        verdicts.append(judge(tests[40, 0], tests[:40])["reproduced"])
    assert verdicts.count(False) <= 300 * level + 3 * np.sqrt(300 * level)
    assert verdicts.count(True) >= 0.7 * 300


def test_printed_points_meet_the_same_steps_of_ours() -> None:
    trace = Trace({1: 5.0, 3: 20.0}, np.array([[[1.0, 2.0, 3.0]], [[10.0, 20.0, 30.0]]]))
    places = trace.places()
    assert [(point["at"], point["ours"]) for point in places] == [(1, [1, 10]), (3, [3, 30])]
    assert trace.last() | {"at": 3} == places[1]


def test_a_test_holds_choices_and_goes_on_where_an_episode_would_have_ended() -> None:
    """As a plain loop over the single environment does that ignores the ends."""
    limits = {"min_torso_height": 0.6, "max_episode_steps": 50}
    world = World(WORLD.xml, article.ENV.model_copy(update=limits))
    env = RobotEnv(world)
    observation, _ = env.reset(seed=7)
    rng = np.random.default_rng(3)
    expected, rewards, ends = [], [], []
    for step in range(150):
        if step % 3 == 0:
            expected.append(observation[None])
            torques = rng.uniform(-1, 1, (1, 8))
        observation, reward, terminated, truncated, _ = env.step(torques[0])
        rewards.append(reward)
        ends.append(terminated or truncated)
    assert any(ends[:100]) and sum(rewards[100:]) > 0

    observed: list[np.ndarray] = []
    rng = np.random.default_rng(3)

    def act(observations: np.ndarray) -> np.ndarray:
        observed.append(observations)
        return rng.uniform(-1, 1, (1, 8))

    np.testing.assert_array_equal(play(world, act, 3, seeds=[7], num_steps=150), [rewards])
    np.testing.assert_array_equal(observed, expected)


def test_a_state_that_is_not_finite_earns_nothing_any_more() -> None:
    world = World(robot.build(article.ROBOT.model_copy(update={"gear": 1e12})), article.ENV)
    torques = iter(np.repeat([0.0, 1.0], [5, 55]))
    rewards = play(world, lambda _: np.full((1, 8), next(torques)), 1, seeds=[0], num_steps=60)
    assert (rewards[0, :3] > 0).all()
    assert (rewards[0, 8:] == 0).all()


def network(algorithm: str) -> tuple[Any, Any]:
    """Return an untrained model of Stable-Baselines3 and the policy of its file."""
    update = {"net_arch": [16, 8], "buffer_size": 10, "num_envs": 1, "velocity_scale": 0.3}
    agent: Any = params_file.load().agents[algorithm].model_copy(update=update)
    model = make_model(make_envs(Job(WORLD, agent, seed=5)), agent, seed=5)
    if algorithm == "sac":
        with torch.no_grad():  # an untrained layer hardly varies, and clips nothing
            model.actor.log_std.weight.mul_(12.0)
            model.actor.log_std.bias.sub_(0.5)
    actions = ActionSet.of(agent.actions, article.ENV.commands)
    return model, policy_file.parse(policy_bytes(model, agent, actions))


def generators(count: int) -> list[np.random.Generator]:
    return [np.random.default_rng([0, index]) for index in range(count)]


def test_sac_draws_as_stable_baselines3_does() -> None:
    model, policy = network("sac")
    with torch.no_grad():
        features = torch.from_numpy(OBSERVATIONS.astype(np.float32))
        means, log_stdevs, _ = model.actor.get_action_dist_params(features)
    mean, stdev = policy.gaussian(OBSERVATIONS)
    np.testing.assert_allclose(mean, means.numpy(), atol=1e-5)
    np.testing.assert_allclose(stdev, log_stdevs.exp().numpy(), rtol=1e-4)
    assert log_stdevs.max() == 2.0  # the clipped range is reached
    repeated = np.repeat(OBSERVATIONS[:1], 4000, axis=0)
    ours = policy.explore(repeated, generators(4000))
    theirs, _ = model.predict(repeated.astype(np.float32))
    np.testing.assert_allclose(ours.mean(0), theirs.mean(0), atol=0.06)
    np.testing.assert_allclose(ours.std(0), theirs.std(0), atol=0.04)
    assert ours.std(0).min() > 0.1 and np.abs(ours).max() <= 1
    alone = policy.explore(repeated[1:2], generators(2)[1:])  # a row draws from its own generator
    np.testing.assert_allclose(ours[1:2], alone, rtol=1e-5)


def test_dqn_explores_with_its_epsilon() -> None:
    model, policy = network("dqn")
    repeated = np.repeat(OBSERVATIONS[:1], 6000, axis=0)
    greedy = policy.act(repeated[:1])
    never = policy.explore(OBSERVATIONS, generators(20), epsilon=0.0)
    np.testing.assert_array_equal(never, policy.act(OBSERVATIONS))
    ours = policy.explore(repeated, generators(6000), epsilon=0.3)
    model.exploration_rate = 0.3
    theirs, _ = model.predict(repeated.astype(np.float32))
    table = policy.actions.table
    share = np.mean((ours == greedy).all(1))
    assert share == pytest.approx(0.7 + 0.3 / 5, abs=0.02)
    assert share == pytest.approx(np.mean((table[theirs] == greedy).all(1)), abs=0.03)
    others = [np.mean((ours == row).all(1)) for row in table if (row != greedy[0]).any()]
    np.testing.assert_allclose(others, 0.06, atol=0.015)


class SeededStart(RobotEnv):
    """Starts from a known state, as EvoTorch resets without a seed."""

    def reset(self, **_: Any) -> Any:
        return super().reset(seed=3)


def test_the_film_of_pgpe_is_that_of_a_fresh_problem() -> None:
    """EvoTorch's `visualize` is this `run`, drawn: its normaliser has seen nothing all along."""
    rng = np.random.default_rng(1)
    weight, bias = rng.normal(0, 0.1, (8, 27)), rng.normal(0, 0.1, 8)
    numbers = (weight, bias, rng.normal(0, 1, 27), rng.uniform(0.5, 2, 27), weight, bias)
    policy = LinearPolicy(*(array.astype(np.float32) for array in numbers), ActionSet())
    fresh = GymNE(
        lambda: SeededStart(WORLD),
        "Linear(obs_length, act_length)",
        observation_normalization=True,
        decrease_rewards_by=1,
        episode_length=40,
    )
    solution = torch.from_numpy(np.concatenate([policy.weight.ravel(), policy.bias]))
    theirs = fresh.run(fresh.to_policy(solution), num_episodes=1)
    assert theirs["interaction_count"] == 40

    def total(policy: LinearPolicy) -> float:
        return float(play(WORLD, policy.act, 1, seeds=[3], num_steps=40).sum())

    film = total(reproduction.without_normalizer(policy))
    assert film == pytest.approx(theirs["cumulative_reward"] + 40, rel=1e-3)
    assert total(policy) != pytest.approx(film, rel=0.05)


def test_tests_together_are_those_alone() -> None:
    """Each has its own start state and exploration, whatever else is tested."""
    _, policy = network("dqn")
    together = reproduction.test(WORLD, [policy, policy], [4, 9], 3, epsilon=0.2)
    assert together.shape == (2, 3, 1000)
    assert len({*together[:, :, -1].ravel()}) == 6
    alone = reproduction.test(WORLD, [policy], [9], 2, epsilon=0.2)
    np.testing.assert_allclose(together[1, :2], alone[0], rtol=1e-9)


def test_the_control_is_the_command_that_lifts_all_feet_but_for_random_ones() -> None:
    """The loop beside it knows nothing of policies or batches."""
    agent: Any = params_file.load().agents["dqn"]
    actions = ActionSet.of(agent.actions.model_copy(update={"hold": 1}), article.ENV.commands)
    env, totals = RobotEnv(WORLD), []
    for number in range(2):
        env.reset(seed=derive(0, "test", 2 * number))
        generator = np.random.default_rng(derive(0, "test", 2 * number + 1))
        total = 0.0
        for _ in range(1000):
            command = generator.integers(5) if generator.random() < 0.05 else 4
            total += env.step(actions.torques(np.array([command]))[0])[1]
        totals.append(total)
    found = reproduction.control(WORLD, actions, 0.05, 2)
    assert found["mean"] == pytest.approx(np.mean(totals))
    assert found["tests"]["reached"] == [sum(total >= 527.5 for total in totals)]
    assert 0 <= found["probability"]["low"] <= found["probability"]["value"]
