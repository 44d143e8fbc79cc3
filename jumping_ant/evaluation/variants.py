"""Variants of an agent's policies, which show the effect of a part of them.

| variant | policy | agents |
|---|---|---|
| final | the policy at the end of training | all |
| best_sample | the best of several policies drawn from the final search distribution | PGPE |

The published policy is the best snapshot in validation, or the last policy; the best sample is also
chosen on validation episodes. Variants run on the same held-out episodes as published policies.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from jumping_ant.agents import catalogue
from jumping_ant.base.seeding import derive
from jumping_ant.evaluation import playing
from jumping_ant.evaluation.episodes import PUBLISHED
from jumping_ant.params.blocks import SELECTION_EPISODES
from jumping_ant.params.model import Params
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.policies.policy import Policy
from jumping_ant.sim.rollout import Episode, Play
from jumping_ant.sim.world import World

Array = NDArray[np.float64]

NUM_SAMPLES = 20  # policies of a generation in the article
NUM_FINALISTS = 4  # of them, which play the rest of the episodes
FIRST_EPISODES = 4  # that all samples play


def make(
    world: World, params: Params, agent: str, policies: Mapping[int, tuple[Policy, Policy]]
) -> dict[int, dict[str, Policy]]:
    """Return the versions by name of each seed's published policy and its policy at the end."""
    samples = dict[int, Policy]()
    if catalogue.row(params.agent(agent)).has_best_sample:
        samples = _best_samples(
            world, params, agent, {seed: final for seed, (_, final) in policies.items()}
        )
    variants = {}
    for seed, (published, final) in policies.items():
        variants[seed] = {PUBLISHED: published, "final": final}
        if samples:
            variants[seed]["best_sample"] = samples[seed]
    return variants


def _best_samples(
    world: World, params: Params, agent: str, final: Mapping[int, Policy]
) -> dict[int, Policy]:
    """Return the best of each seed's samples: after a few episodes, finalists play the others."""
    samples: dict[int, list[Policy]] = {}
    for seed, policy in final.items():
        if not isinstance(policy, LinearPolicy):
            raise TypeError(f"given {type(policy).__name__}, allowed: LinearPolicy")
        generator = np.random.default_rng(derive(seed, "samples"))
        samples[seed] = [policy.sample(generator) for _ in range(NUM_SAMPLES)]

    def totals(played: Mapping[int, Sequence[Policy]], places: range) -> Array:
        """Return sums of returns, shape (num_seeds, policies of each)."""
        plays = {
            seed: [Play(one, params.training.block(seed)[place]) for one in own for place in places]
            for seed, own in played.items()
        }
        workers = params.compute.workers
        returns = playing.play(world, agent, "validation", plays, Episode.total, workers)
        return np.array(returns).reshape(len(played), -1, len(places)).sum(axis=2)

    first = totals(samples, range(FIRST_EPISODES))
    ranks = np.argsort(-first, axis=1, kind="stable")[:, :NUM_FINALISTS]
    finalists = {
        seed: [own[rank] for rank in ahead]
        for (seed, own), ahead in zip(samples.items(), ranks, strict=True)
    }
    others = totals(finalists, range(FIRST_EPISODES, SELECTION_EPISODES))
    best = (np.take_along_axis(first, ranks, axis=1) + others).argmax(axis=1)
    return {seed: own[rank] for (seed, own), rank in zip(finalists.items(), best, strict=True)}
