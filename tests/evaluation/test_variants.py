"""Other versions of a policy, and what they return on the held-out episodes."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from jumping_ant.evaluation import episodes, variants
from jumping_ant.params.blocks import SELECTION_EPISODES, EvaluateParams
from jumping_ant.params.model import Params
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


def test_a_policy_has_the_variants_that_make_sense_for_it(robot_xml: str, params: Params) -> None:
    def names(agent: str, policy: Policy) -> list[str]:
        return list(made(robot_xml, params, agent, {3: policy})[3])

    assert names("pgpe", linear(0.1)) == ["published", "final", "best_sample"]
    assert names("sac", linear(0.1)) == ["published", "final"]
    assert names("random", UniformPolicy(0, ActionSet(), 8)) == ["published", "final"]


def test_what_claims_compare_is_played_on_more_episodes(known_params: Params) -> None:
    evaluate = EvaluateParams(episodes=32, baseline_episodes=16, seed=0)
    for agent, counts in {
        "pgpe": {"published": 32, "final": 32, "best_sample": 32},  # `final` is the centre
        "sac": {"published": 32, "final": 16},
        "random": {"published": 16, "final": 16},
    }.items():
        assert episodes.num_episodes(known_params.agent(agent), evaluate) == counts


def test_the_best_sample_wins_two_rounds_of_validation(robot_xml: str, params: Params) -> None:
    world, centers = World(robot_xml, params.env), {7: linear(0.5), 9: linear(0.4)}
    found = made(robot_xml, params, "pgpe", centers)
    for seed, center in centers.items():
        generator = np.random.default_rng(variants.derive(seed, "samples"))
        episodes = params.training.block(seed)[:SELECTION_EPISODES]
        samples = [center.sample(generator) for _ in range(variants.NUM_SAMPLES)]
        returns = np.array(
            [[own.total() for own in rollout.run(world, each, episodes)] for each in samples]
        )
        first = returns[:, : variants.FIRST_EPISODES].sum(axis=1)
        finalists = np.argsort(first)[-variants.NUM_FINALISTS :]
        best = finalists[returns[finalists].sum(axis=1).argmax()]
        np.testing.assert_array_equal(found[seed]["best_sample"].weight, samples[best].weight)
