"""Other versions of a policy, and what they return on the held-out episodes."""

from dataclasses import replace

import numpy as np
import pytest
from commands import COMMAND_SIGNS

from jumping_ant.actions import ActionSet
from jumping_ant.evaluation import evaluation, variants
from jumping_ant.experiment.models import SELECTION_EPISODES, Params
from jumping_ant.params.blocks import EnvParams
from jumping_ant.policies.blind import UniformPolicy
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.sim import rollout
from jumping_ant.sim.world import World

VALIDATION_SEED = 2000000


def linear(spread: float, hold: int = 1) -> LinearPolicy:
    generator = np.random.default_rng(3)
    weight = generator.normal(0, 0.3, (8, 27)).astype(np.float32)
    bias = generator.normal(0, 0.3, 8).astype(np.float32)
    return LinearPolicy(
        weight,
        bias,
        np.zeros(27, np.float32),
        np.ones(27, np.float32),
        np.full_like(weight, spread),
        np.full_like(bias, spread),
        ActionSet(hold=hold),
    )


@pytest.fixture(scope="module")
def short(known_params: Params) -> EnvParams:
    return known_params.env.model_copy(update={"max_episode_steps": 20})


class Chooser:
    """A policy whose torques the test chooses."""

    actions = ActionSet(hold=2)

    def __init__(self, torques: list[list[float]]) -> None:
        self._torques = np.array(torques)

    def start(self, episode_seeds) -> None:
        pass

    def act(self, observations):
        return self._torques


def test_rounding_takes_the_nearest_command() -> None:
    torques = [[0.2] * 8, [0.3] * 8, [0.9, 0.1] * 2 + [-0.2] * 4, [-1.0] * 4 + [0.1] * 4]
    rounded = variants.RoundedPolicy(Chooser(torques), 0.5 * COMMAND_SIGNS)
    assert rounded.act(np.zeros((4, 27))).tolist() == [
        [0.0] * 8,
        [0.5] * 8,
        [0.5] * 4 + [-0.5] * 4,
        [-0.5] * 4 + [0.5] * 4,
    ]
    assert rounded.actions.hold == 2


def test_a_policy_has_the_variants_that_make_sense_for_it(robot_xml: str, short: EnvParams) -> None:
    policy, uniform = linear(0.1), UniformPolicy(0, ActionSet(), 8)
    found = variants.make(World(robot_xml, short), "pgpe", policy, policy, 0, VALIDATION_SEED)
    assert list(found) == ["final", "rounded", "best_sample"]
    found = variants.make(World(robot_xml, short), "sac", policy, policy, 0, VALIDATION_SEED)
    assert list(found) == ["final", "rounded"]
    found = variants.make(World(robot_xml, short), "snes", policy, policy, 0, VALIDATION_SEED)
    assert list(found) == ["final"]
    found = variants.make(World(robot_xml, short), "random", uniform, uniform, 0, VALIDATION_SEED)
    assert list(found) == ["final"]


def test_the_best_sample_is_the_best_in_validation(robot_xml: str, short: EnvParams) -> None:
    policy = linear(0.5)

    def score(sample: LinearPolicy) -> float:
        seeds = [VALIDATION_SEED + i for i in range(SELECTION_EPISODES)]
        return sum(e.rewards.sum() for e in rollout.run(World(robot_xml, short), sample, seeds))

    best = variants.make(World(robot_xml, short), "pgpe", policy, policy, 7, VALIDATION_SEED)[
        "best_sample"
    ]
    assert isinstance(best, LinearPolicy)
    generator = np.random.default_rng(variants.derive(7, "samples"))
    scores = [score(policy.sample(generator)) for _ in range(variants.NUM_SAMPLES)]
    assert score(best) == max(scores) > min(scores)


def test_without_spread_the_best_sample_is_the_center(robot_xml: str, short: EnvParams) -> None:
    policy = linear(0.0)
    best = variants.make(World(robot_xml, short), "pgpe", policy, policy, 0, VALIDATION_SEED)[
        "best_sample"
    ]
    assert isinstance(best, LinearPolicy)
    np.testing.assert_array_equal(best.weight, policy.weight)


def test_variants_are_measured_on_the_held_out_episodes(
    robot_xml: str, known_params: Params, short: EnvParams
) -> None:
    evaluate = known_params.evaluate.model_copy(update={"episodes": 2})
    world = World(robot_xml, short)
    policies = {4: linear(0.0), 9: replace(linear(0.0), bias=np.ones(8, np.float32))}
    again = {seed: replace(policy) for seed, policy in policies.items()}
    others = {seed: {"final": policies[seed], "again": again[seed]} for seed in policies}
    episodes, _ = evaluation.evaluate(world, evaluate, "pgpe", policies)
    table = evaluation.evaluate_variants(world, evaluate, (policies, episodes), others)
    assert table[["seed", "variant"]].values.tolist() == [
        [4, "final"],
        [4, "again"],
        [9, "final"],
        [9, "again"],
    ]
    means = evaluation.seed_means(episodes)
    for variant in ("final", "again"):
        own = table[table["variant"] == variant].drop(columns="variant").reset_index(drop=True)
        np.testing.assert_array_equal(own.values, means.values)
