"""Variants of an agent's policies, which show the effect of a part of them.

| variant | policy | agents |
|---|---|---|
| final | the policy at the end of training | all |
| rounded | every choice of torques replaced by the nearest command | agents that choose torques |
| best_sample | the best of several policies drawn from the final search distribution | evolution |

The published policy is the best snapshot in validation, or the last policy; the best sample is also
chosen on validation episodes. Variants run on the same held-out episodes as published policies.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from jumping_ant.actions import ActionSet
from jumping_ant.base.seeding import derive
from jumping_ant.params.blocks import EnvParams
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.policies.networks import Network
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import rollout

Array = NDArray[np.float64]

NUM_SAMPLES = 20  # policies of a generation in the article
SELECTION_EPISODES = 4  # that the best sample is chosen on
AMPLITUDE = 0.5  # of the article's commands


@dataclass(frozen=True)
class RoundedPolicy:
    """A policy whose torques are replaced by the nearest command.

    Attributes:
        policy: The policy that chooses.
        commands: Torques over peak torques of each command, shape (num_commands, num_motors).
    """

    policy: Policy
    commands: Array

    @property
    def num_observations(self) -> int | None:
        """Number of values in an observation."""
        return self.policy.num_observations

    @property
    def num_motors(self) -> int:
        """Number of torques that the policy returns."""
        return self.policy.num_motors

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


def make(
    xml: str,
    env: EnvParams,
    published: Policy,
    final: Policy,
    seed: int,
    validation_seed: int,
    num_threads: int = 1,
) -> dict[str, Policy]:
    """Return the variants of one seed's policy, by name.

    Args:
        xml: The robot as MJCF text.
        env: The task.
        published: The seed's policy.
        final: The seed's last policy.
        seed: The agent's seed, which the samples' random numbers are derived from.
        validation_seed: Seed of the first validation episode.
        num_threads: Threads that step the simulations; results do not depend on it.
    """
    variants: dict[str, Policy] = {"final": final}
    if isinstance(published, Network | LinearPolicy) and published.actions.table is None:
        commands = AMPLITUDE * np.array(env.commands, dtype=np.float64)
        variants["rounded"] = RoundedPolicy(published, commands)
    if isinstance(final, LinearPolicy):
        generator = np.random.default_rng(derive(seed, "samples"))
        samples = [final.sample(generator) for _ in range(NUM_SAMPLES)]
        episode_seeds = [validation_seed + i for i in range(SELECTION_EPISODES)]
        played = [rollout.run(xml, env, sample, episode_seeds, num_threads) for sample in samples]
        returns = [sum(episode.rewards.sum() for episode in episodes) for episodes in played]
        variants["best_sample"] = samples[int(np.argmax(returns))]
    return variants
