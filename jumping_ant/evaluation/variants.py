"""Variants of an agent's policies, which show the effect of a part of them.

| variant | policy | agents |
|---|---|---|
| final | the policy at the end of training | all |
| signed | the sign of each torque, at the agent's amplitude | SAC and PGPE on torques |
| three | for each motor the nearest of minus the amplitude, none and the amplitude | the same |
| rounded_full | the nearest of the five commands, at the agent's amplitude | the same |
| rounded | the nearest of the five commands, at half torque as in the article | the same |
| best_sample | the best of several policies drawn from the final search distribution | PGPE |

The published policy is the best snapshot in validation, or the last policy; the best sample is also
chosen on validation episodes. Variants run on the same held-out episodes as published policies.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from jumping_ant.agents import catalogue
from jumping_ant.base.seeding import derive
from jumping_ant.evaluation import playing
from jumping_ant.evaluation.episodes import PUBLISHED, variant_names
from jumping_ant.params.blocks import EnvParams
from jumping_ant.params.model import SELECTION_EPISODES, Params
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.policies.policy import Policy, Stateless
from jumping_ant.sim.rollout import Episode, Play
from jumping_ant.sim.world import World

Array = NDArray[np.float64]

NUM_SAMPLES = 20  # policies of a generation in the article
NUM_FINALISTS = 4  # of them, which play the rest of the episodes
FIRST_EPISODES = 4  # that all samples play
AMPLITUDE = 0.5  # of the article's commands


@dataclass(frozen=True)
class NearestCommand(Stateless):
    """A stateless policy whose torques are replaced by the nearest command."""

    policy: Policy
    commands: Array  # torques over peak torques, (num_commands, num_motors)

    @property
    def actions(self) -> ActionSet:
        """Actions that the policy itself chooses from; choices are held for as long."""
        return self.policy.actions

    def act(self, observations: Array) -> Array:
        """Return the command at the smallest Euclidean distance to the torques, (n, num_motors)."""
        torques = self.policy.act(observations)
        distances = np.square(torques[:, None] - self.commands).sum(axis=-1)
        return self.commands[distances.argmin(axis=1)]


@dataclass(frozen=True)
class NearestLevels(Stateless):
    """A stateless policy whose torques are replaced by the nearest of each motor's levels."""

    policy: Policy
    levels: int

    @property
    def actions(self) -> ActionSet:
        """The levels, up to the amplitude of the policy; choices are held for as long."""
        return replace(self.policy.actions, levels=self.levels)

    def act(self, observations: Array) -> Array:
        """Return the nearest level of each motor, (n, num_motors)."""
        actions = self.actions
        outputs = self.policy.act(observations) / actions.amplitude
        return np.asarray(actions.torques(actions.choices(outputs)))


def make(
    world: World, params: Params, agent: str, policies: Mapping[int, tuple[Policy, Policy]]
) -> dict[int, dict[str, Policy]]:
    """Return the versions by name of each seed's published policy and its policy at the end."""
    block, samples = params.agent(agent), dict[int, Policy]()
    if catalogue.row(block).has_best_sample:
        samples = _best_samples(
            world, params, agent, {seed: final for seed, (_, final) in policies.items()}
        )
    variants = {}
    for seed, (published, final) in policies.items():
        made = {"final": final, **_discrete(published, world.env)}
        made |= {"best_sample": samples[seed]} if samples else {}
        named = {name: made[name] for name in variant_names(block)}
        variants[seed] = {PUBLISHED: published} | named
    return variants


def _discrete(policy: Policy, env: EnvParams) -> dict[str, Policy]:
    """Return the variants of a policy that choose among a few torques."""
    amplitude, commands = policy.actions.amplitude, np.array(env.commands, dtype=np.float64)
    rounded = {own: NearestCommand(policy, own * commands) for own in (amplitude, AMPLITUDE)}
    return {
        "signed": NearestLevels(policy, 2),
        "three": NearestLevels(policy, 3),
        "rounded_full": rounded[amplitude],
        "rounded": rounded[AMPLITUDE],
    }


def _best_samples(
    world: World, params: Params, agent: str, final: Mapping[int, Policy]
) -> dict[int, Policy]:
    """Return the best of each seed's samples: after a few episodes, finalists play the others."""
    first_seed = params.training.evaluation_seed
    episodes = range(first_seed, first_seed + SELECTION_EPISODES)
    samples: dict[int, list[Policy]] = {}
    for seed, policy in final.items():
        if not isinstance(policy, LinearPolicy):
            raise TypeError(f"given {type(policy).__name__}, allowed: LinearPolicy")
        generator = np.random.default_rng(derive(seed, "samples"))
        samples[seed] = [policy.sample(generator) for _ in range(NUM_SAMPLES)]

    def totals(played: Mapping[int, Sequence[Policy]], starts: range) -> Array:
        """Return sums of returns, shape (num_seeds, policies of each)."""
        plays = {
            seed: [Play(one, start) for one in own for start in starts]
            for seed, own in played.items()
        }
        workers = params.compute.workers
        returns = playing.play(world, agent, "validation", plays, Episode.total, workers)
        return np.array(returns).reshape(len(played), -1, len(starts)).sum(axis=2)

    first = totals(samples, episodes[:FIRST_EPISODES])
    ranks = np.argsort(-first, axis=1, kind="stable")[:, :NUM_FINALISTS]
    finalists = {
        seed: [own[rank] for rank in ahead]
        for (seed, own), ahead in zip(samples.items(), ranks, strict=True)
    }
    others = totals(finalists, episodes[FIRST_EPISODES:])
    best = (np.take_along_axis(first, ranks, axis=1) + others).argmax(axis=1)
    return {seed: own[rank] for (seed, own), rank in zip(finalists.items(), best, strict=True)}
