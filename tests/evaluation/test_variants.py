"""Other versions of a policy, and what they return on the held-out episodes."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from commands import COMMAND_SIGNS

from jumping_ant.evaluation import episodes, variants
from jumping_ant.evaluation.variants import NearestCommand, NearestLevels
from jumping_ant.params.blocks import EvaluateParams
from jumping_ant.params.model import SELECTION_EPISODES, Params
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.blind import UniformPolicy
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import rollout
from jumping_ant.sim.world import World


def linear(spread: float) -> LinearPolicy:
    generator = np.random.default_rng(3)
    weight = generator.normal(0, 0.3, (8, 27)).astype(np.float32)
    bias = generator.normal(0, 0.3, 8).astype(np.float32)
    mean, stdev = np.zeros(27, np.float32), np.ones(27, np.float32)
    spreads = np.full_like(weight, spread), np.full_like(bias, spread)
    return LinearPolicy(weight, bias, mean, stdev, *spreads, ActionSet())


@pytest.fixture(scope="module")
def params(known_params: Params) -> Params:
    env = known_params.env.model_copy(update={"max_episode_steps": 20})
    return known_params.model_copy(update={"env": env})


def made(
    robot_xml: str, params: Params, agent: str, centers: Mapping[int, Policy]
) -> dict[int, dict[str, Any]]:
    policies = {seed: (policy, policy) for seed, policy in centers.items()}
    return variants.make(World(robot_xml, params.env), params, agent, policies)


class Chooser:
    """A policy whose torques the test chooses."""

    def __init__(self, torques: list[list[float]]) -> None:
        self.actions = ActionSet(amplitude=0.5, hold=2)
        self._torques = np.array(torques)

    def start(self, episode_seeds) -> None:
        pass

    def act(self, observations):
        return self._torques


CHOOSER = Chooser([[0.2] * 8, [0.3] * 8, [0.9, 0.1] * 2 + [-0.2] * 4, [-1.0] * 4 + [0.1] * 4])
FEET = [[0.5] * 4 + [-0.5] * 4, [-0.5] * 4 + [0.5] * 4]  # commands 3 and 4 at half torque
FEET_OR_NONE = [[0.5, 0.0] * 2 + [0.0] * 4, [-0.5] * 4 + [0.0] * 4]


@pytest.mark.parametrize(
    ("variant", "levels", "expected"),
    [
        (NearestCommand(CHOOSER, 0.5 * COMMAND_SIGNS), None, [[0.0] * 8, [0.5] * 8, *FEET]),
        (NearestLevels(CHOOSER, 2), 2, [[0.5] * 8, [0.5] * 8, *FEET]),
        (NearestLevels(CHOOSER, 3), 3, [[0.0] * 8, [0.5] * 8, *FEET_OR_NONE]),
    ],
)
def test_torques_become_the_nearest_of_a_few(
    variant: Policy, levels: int | None, expected: list[list[float]]
) -> None:
    assert variant.act(np.zeros((4, 27))).tolist() == expected
    assert (variant.actions.levels, variant.actions.hold) == (levels, 2)


def test_a_policy_has_the_variants_that_make_sense_for_it(robot_xml: str, params: Params) -> None:
    def names(agent: str, policy: Policy, params: Params = params) -> list[str]:
        return list(made(robot_xml, params, agent, {3: policy})[3])

    policy, discrete = linear(0.1), ["signed", "three", "rounded_full", "rounded"]
    block: Any = params.agent("pgpe")
    choice = block.actions.model_copy(update={"kind": "levels"})
    levels = {"pgpe": block.model_copy(update={"actions": choice})}
    of_levels = params.model_copy(update={"agents": levels})
    assert names("pgpe", policy) == ["published", "final", *discrete, "best_sample"]
    assert names("pgpe", policy, of_levels) == ["published", "final", "best_sample"]
    assert names("sac", policy) == ["published", "final", *discrete]
    assert names("dqn", policy) == ["published", "final"]
    assert names("random", UniformPolicy(0, ActionSet(), 8)) == ["published", "final"]


def test_what_claims_compare_is_played_on_more_episodes(known_params: Params) -> None:
    evaluate = EvaluateParams(episodes=32, baseline_episodes=16, seed=0)

    def played_more(agent: str) -> set[str]:
        counts = episodes.num_episodes(known_params.agent(agent), evaluate)
        assert set(counts.values()) == {16, 32}
        return {version for version, count in counts.items() if count == 32}

    compared = {"signed", "rounded_full", "rounded", "best_sample"}
    assert played_more("pgpe") == {"published", "final", *compared}  # `final` is the centre
    assert played_more("sac") == {"published", *compared}
    assert played_more("random") == compared  # which it has not


@pytest.mark.parametrize("amplitude", [1.0, 0.5])
def test_commands_at_full_amplitude_are_those_at_half_where_the_two_are_equal(
    robot_xml: str, params: Params, amplitude: float
) -> None:
    policy = replace(linear(0.1), actions=ActionSet(amplitude=amplitude))
    found = made(robot_xml, params, "sac", {3: policy})[3]
    is_same = found["rounded_full"] is found["rounded"]  # and so is played once
    assert is_same == (amplitude == 0.5)
    np.testing.assert_array_equal(found["rounded_full"].commands, amplitude * COMMAND_SIGNS)


def test_the_best_sample_wins_two_rounds_of_validation(robot_xml: str, params: Params) -> None:
    world, centers = World(robot_xml, params.env), {7: linear(0.5), 9: linear(0.4)}
    first_seed = params.training.evaluation_seed
    episodes = range(first_seed, first_seed + SELECTION_EPISODES)
    found = made(robot_xml, params, "pgpe", centers)
    for seed, center in centers.items():
        generator = np.random.default_rng(variants.derive(seed, "samples"))
        samples = [center.sample(generator) for _ in range(variants.NUM_SAMPLES)]
        returns = np.array(
            [[own.total() for own in rollout.run(world, each, episodes)] for each in samples]
        )
        first = returns[:, : variants.FIRST_EPISODES].sum(axis=1)
        finalists = np.argsort(first)[-variants.NUM_FINALISTS :]
        best = finalists[returns[finalists].sum(axis=1).argmax()]
        np.testing.assert_array_equal(found[seed]["best_sample"].weight, samples[best].weight)
