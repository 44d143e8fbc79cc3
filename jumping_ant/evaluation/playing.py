"""Many episodes of an agent's policies, with a display of how many have been played."""

from collections.abc import Iterator, Sequence
from itertools import chain

from jumping_ant.base import progress
from jumping_ant.sim import rollout
from jumping_ant.sim.rollout import LARGEST_BATCH, Episode, Play
from jumping_ant.sim.world import World


def play(
    world: World, plays: Sequence[Play], agent: str, kind: str, num_threads: int = 1
) -> Iterator[Episode]:
    """Yield an episode for each policy and seed, as `rollout.play` does.

    Args:
        world: The robot and the task.
        plays: The policies, each with an episode's seed.
        agent: The agent's name, for the display.
        kind: What the episodes are.
        num_threads: Threads that step the simulations; nothing depends on it.
    """
    parts = (
        list(rollout.play(world, plays[first : first + LARGEST_BATCH], num_threads))
        for first in range(0, len(plays), LARGEST_BATCH)
    )
    return chain.from_iterable(progress.shown(parts, len(plays), agent, f"{kind} episodes"))
