"""Variants of an agent's policies, which show the effect of a part of them.

| variant | policy | agents |
|---|---|---|
| final | the policy at the end of training | all |
| rounded | every choice of torques replaced by the nearest command | SAC and PGPE on torques |
| best_sample | the best of several policies drawn from the final search distribution | PGPE |

The published policy is the best snapshot in validation, or the last policy; the best sample is also
chosen on validation episodes. Variants run on the same held-out episodes as published policies.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.actions import ActionSet
from jumping_ant.base.seeding import derive
from jumping_ant.experiment import variant_names
from jumping_ant.experiment.models import SELECTION_EPISODES
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import rollout
from jumping_ant.sim.world import World

Array = NDArray[np.float64]

NUM_SAMPLES = 20  # policies of a generation in the article
AMPLITUDE = 0.5  # of the article's commands


@dataclass(frozen=True)
class RoundedPolicy:
    """A policy whose torques are replaced by the nearest command."""

    policy: Policy
    commands: Array  # torques over peak torques, (num_commands, num_motors)

    @property
    def actions(self) -> ActionSet:
        """Actions that the policy itself chooses from; choices are held for as long."""
        return self.policy.actions

    def start(self, episode_seeds: Sequence[int]) -> None:
        """Begin one episode per seed."""
        self.policy.start(episode_seeds)

    def act(self, observations: Array) -> Array:
        """Return the command at the smallest Euclidean distance to the torques, (n, num_motors)."""
        torques = self.policy.act(observations)
        distances = np.square(torques[:, None] - self.commands).sum(axis=-1)
        return self.commands[distances.argmin(axis=1)]


@dataclass(frozen=True)
class SideBySide:
    """Policies of the same actions, each of which plays as many of the episodes, in order."""

    policies: Sequence[Policy]

    @property
    def actions(self) -> ActionSet:
        """Actions that each of the policies chooses from."""
        return self.policies[0].actions

    def start(self, episode_seeds: Sequence[int]) -> None:
        """Begin one episode per seed."""
        for policy, seeds in zip(self.policies, self._shares(np.array(episode_seeds)), strict=True):
            policy.start(seeds.tolist())

    def act(self, observations: Array) -> Array:
        """Return torques in [-1, 1], shape (n, num_motors)."""
        shares = zip(self.policies, self._shares(observations), strict=True)
        return np.concatenate([policy.act(own) for policy, own in shares])

    def _shares(self, rows: NDArray[Any]) -> list[NDArray[Any]]:
        return np.split(rows, len(self.policies))


def make(
    world: World,
    algorithm: str,
    published: Policy,
    final: Policy,
    seed: int,
    validation_seed: int,
    num_threads: int = 1,
) -> dict[str, Policy]:
    """Return the variants of one seed's published policy, by name.

    `validation_seed` is that of the first episode by which the best sample is chosen.
    """
    names = variant_names.names(algorithm, published.actions.chooses_torques)
    variants: dict[str, Policy] = {"final": final}
    if "rounded" in names:
        commands = AMPLITUDE * np.array(world.env.commands, dtype=np.float64)
        variants["rounded"] = RoundedPolicy(published, commands)
    if "best_sample" in names and isinstance(final, LinearPolicy):
        generator = np.random.default_rng(derive(seed, "samples"))
        samples = [final.sample(generator) for _ in range(NUM_SAMPLES)]
        episode_seeds = [validation_seed + i for i in range(SELECTION_EPISODES)]
        seeds = episode_seeds * NUM_SAMPLES
        episodes = rollout.run(world, SideBySide(samples), seeds, num_threads)
        returns = np.array([episode.rewards.sum() for episode in episodes])
        totals = returns.reshape(NUM_SAMPLES, SELECTION_EPISODES).sum(axis=1)
        variants["best_sample"] = samples[int(np.argmax(totals))]
    return variants
