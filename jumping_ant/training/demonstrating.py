"""Demonstrations of a trained agent, for agents that imitate it: of its best seed in validation."""

from pathlib import Path

from jumping_ant.agents.imitation.demonstrations import Demonstrations, Labelled, concatenated, play
from jumping_ant.base.paths import Paths
from jumping_ant.params.model import EPISODES_AT_ONCE, Params
from jumping_ant.policies import policy_file
from jumping_ant.sim import robot
from jumping_ant.sim.world import World
from jumping_ant.training import curves


def demonstrate(root: Path, params: Params, algorithm: str, num_threads: int = 1) -> Demonstrations:
    """Return what an agent demonstrates for an algorithm that has an entry in `demonstrations`."""
    settings = params.demonstrations[algorithm]
    agent = params.agent(settings.agent)
    best, *_ = curves.best_first(root, settings.agent, params.seeds)
    paths = Paths(root).agent(settings.agent).seed(best)
    content = paths.content(paths.policy)
    world = World(robot.read(root, agent.robot), params.env)
    policy, steps = policy_file.parse(content), 0
    episodes: list[Labelled] = []
    while steps < settings.steps:
        first = settings.seed + EPISODES_AT_ONCE * len(episodes)
        starts = list(range(first, first + EPISODES_AT_ONCE))
        length, tumbled = settings.episode_steps, settings.tumbled_starts
        played = play(world, policy, policy, starts, length, tumbled, num_threads)
        episodes.append(played)
        steps += len(played) * policy.actions.hold
    return Demonstrations(concatenated(episodes), content)
