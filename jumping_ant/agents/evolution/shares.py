"""Shares of a population: each plays its policies' episodes side by side, in one batch.

EvoTorch has actors on Ray, too, but these would change bytes. It draws their seeds from the random
numbers of the search, gives a share to whichever actor is free, though each policy has start states
of its own, and adds up each actor's sums of observations: single-precision numbers in another order
for every split. So a share returns its observations, and whoever has them all sums them up.
"""

from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from jumping_ant.actions import ActionSet
from jumping_ant.agents import kernels
from jumping_ant.sim import rollout
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World

Array = NDArray[Any]
Act = Callable[[Array], Array]  # policies' outputs for their observations, a row for each


@dataclass(frozen=True)
class Play:
    """What a share of n policies plays."""

    start: Callable[[], Act]  # begins an episode of all; picklable
    generators: Sequence[np.random.Generator]  # of each policy's start states


@dataclass(frozen=True)
class Episodes:
    """Episodes of n policies, of at most T decisions."""

    alive: NDArray[np.bool_]  # whether a policy took that decision, true at the start, (T + 1, n)
    returns: NDArray[np.float64]  # (n,)
    generators: Sequence[np.random.Generator]  # as they are after the start
    seen: NDArray[np.float32] | None  # if asked for, observations where `alive`, in its order


class Share:
    """Robots for policies that play side by side.

    Args:
        world: The robot and the task.
        actions: What policies choose from.
        episode_steps: Length of an episode [control steps].
        keeps_observations: Whether to return them; they are most of what moves between machines.
    """

    def __init__(
        self, world: World, actions: ActionSet, episode_steps: int, *, keeps_observations: bool
    ) -> None:
        kernels.use()  # this process may be another than that of the trainer
        self._world, self._actions = world, actions
        self._episode_steps = episode_steps
        self._keeps_observations = keeps_observations
        self._envs: RobotVectorEnv | None = None

    def play(self, play: Play) -> Episodes:
        """Run an episode of each policy."""
        envs, count = self._robots(len(play.generators)), len(play.generators)
        envs.generators = deepcopy(list(play.generators))
        decisions = -(-self._episode_steps // self._actions.hold)
        num_observations = self._world.anatomy.num_observations
        observations = np.zeros((decisions + 1, count, num_observations), np.float32)
        alive, returns = np.zeros((decisions + 1, count), np.bool_), np.zeros(count)
        outputs = play.start()
        start, _ = envs.reset()
        observations[0], alive[0] = start, True
        steps = rollout.steps(envs, start, lambda seen: self._actions.choices(outputs(seen)))
        for number, step in enumerate(steps, start=1):
            observations[number], alive[number] = step.next_observations, step.alive
            returns += step.rewards
        seen = observations[alive] if self._keeps_observations else None
        return Episodes(alive, returns, envs.generators, seen)

    def _robots(self, count: int) -> RobotVectorEnv:
        if self._envs is None or self._envs.num_envs != count:
            self._envs = RobotVectorEnv(
                self._world,
                count,
                autoreset_mode=AutoresetMode.DISABLED,
                actions=self._actions,
                episode_steps=np.full(count, self._episode_steps),
            )
        return self._envs


def joined(episodes: Sequence[Episodes]) -> Episodes:
    """Return the episodes of a population from those of its shares, whatever the split."""
    alive = np.concatenate([own.alive for own in episodes], axis=1)
    returns = np.concatenate([own.returns for own in episodes])
    generators = [generator for own in episodes for generator in own.generators]
    if episodes[0].seen is None:
        return Episodes(alive, returns, generators, None)
    places = alive.cumsum().reshape(alive.shape) - 1
    seen = np.empty((alive.sum(), episodes[0].seen.shape[1]), np.float32)
    first = 0
    for own in episodes:
        last = first + len(own.returns)
        seen[places[:, first:last][own.alive]] = own.seen
        first = last
    return Episodes(alive, returns, generators, seen)
