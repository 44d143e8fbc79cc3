"""The memory use of the article's script for one seed.

Usage: python -m benchmarks.notebook

One notebook trains DQN, then SAC, then PGPE on every core, and keeps what it has trained. Instead
of an hour of training, the pages of the replay buffers that it would fill are written at once.
"""

import time
from typing import cast

from stable_baselines3 import DQN, SAC
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

from benchmarks import evolution
from benchmarks.article_ant import ArticleAnt, Commanded, article_agent, default_world
from jumping_ant.policies.actions import ActionSet

STEPS = 300  # of real training, so that networks and optimisers are allocated
SECONDS_TO_STAY = 3.0  # at the peak, so that it is sampled


def main() -> None:
    """Train the three learners, and keep them in memory."""
    env = ArticleAnt()
    actions = ActionSet.of(article_agent("dqn").actions, default_world().env.commands)
    models: dict[str, OffPolicyAlgorithm] = {
        "dqn": DQN("MlpPolicy", Commanded(env, actions)),
        "sac": SAC("MlpPolicy", env),
    }
    for name, model in models.items():
        model.learn(STEPS)
        fill(cast(ReplayBuffer, model.replay_buffer), article_agent(name).total_steps)
    searcher = evolution.gymne()
    time.sleep(SECONDS_TO_STAY)
    del searcher  # its actors end with it


def fill(buffer: ReplayBuffer, num_transitions: int) -> None:
    """Write the memory pages that a number of transitions take."""
    columns = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
    for column in columns:
        getattr(buffer, column)[:num_transitions] = 0


if __name__ == "__main__":
    main()
