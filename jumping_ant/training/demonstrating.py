"""Demonstrations of a trained agent, for agents that imitate it.

The seed that did best in validation demonstrates, in episodes that are neither those of validation
nor the held-out ones (`Params` sees to that).
"""

from pathlib import Path

from jumping_ant.agents.imitation.demonstrations import (
    Demonstrations,
    Labelled,
    concatenated,
    play,
)
from jumping_ant.base.files import read_bytes
from jumping_ant.base.paths import Paths
from jumping_ant.params.blocks import DemonstrationParams
from jumping_ant.params.model import EPISODES_AT_ONCE, Params
from jumping_ant.policies import policy_file
from jumping_ant.sim import robot
from jumping_ant.sim.world import World
from jumping_ant.training import validation


def demonstrate(root: Path, params: Params, algorithm: str, num_threads: int = 1) -> Demonstrations:
    """Return what an agent demonstrates for an algorithm that has an entry in `demonstrations`."""
    settings = params.demonstrations[algorithm]
    agent = params.agent(settings.agent)
    best, *_ = validation.best_first(root, settings.agent, params.seeds)
    paths = Paths(root).agent(settings.agent).seed(best)
    content = read_bytes(paths.policy, f"train@{settings.agent}")
    policy_file.parse(content, paths.owner)
    world = World(robot.read(root, agent.robot), params.env)
    return record(world, content, settings, num_threads)


def record(
    world: World, expert: bytes, settings: DemonstrationParams, num_threads: int = 1
) -> Demonstrations:
    """Return episodes of an expert, given its policy file's content."""
    policy, steps = policy_file.parse(expert), 0
    episodes: list[Labelled] = []
    while steps < settings.steps:
        first = settings.seed + EPISODES_AT_ONCE * len(episodes)
        starts = list(range(first, first + EPISODES_AT_ONCE))
        length, tumbled = settings.episode_steps, settings.tumbled_starts
        played = play(world, policy, policy, starts, length, tumbled, num_threads)
        episodes.append(played)
        steps += len(played) * policy.actions.hold
    return Demonstrations(concatenated(episodes), expert)
