"""DQN and SAC compared with Stable-Baselines3, called as in the article, and with SBX in JAX."""

import importlib
import os
from collections.abc import Callable
from functools import partial
from typing import Any

import torch

from benchmarks.article_ant import ArticleAnt, Commanded, article_agent, default_world
from benchmarks.measure import Contender, Row, compare_apart, rate
from jumping_ant.agents.job import Job
from jumping_ant.agents.kernels import use_portable_kernels
from jumping_ant.agents.sb3 import trainer
from jumping_ant.policies.actions import ActionSet

REPEATS = 5
STEPS = {"dqn": 1200, "sac": 120}  # control steps per repeat
# Repeats that are not counted. Learning starts in the first; then it gets slower until Adam's means
# for dead neurons have become denormal numbers, and stays that slow.
WARM_UP = {"dqn": 1, "sac": 12}
# The article explores during a fifth of its budget. The rest is measured, in which each step costs
# an extra forward pass and every fourth one a gradient step: both begin within the first steps.
PAST_EXPLORATION: dict[str, Any] = {"exploration_fraction": 1e-6, "learning_starts": 100}


def versus_sb3(algorithm: str) -> Row:
    """Compare with Stable-Baselines3, one thread each."""
    ours, peer = partial(project, algorithm), partial(script, algorithm, num_threads=1)
    return compare_apart(f"{algorithm}_vs_sb3", "env-steps/s", ours, peer, REPEATS)


def versus_sbx(algorithm: str) -> Row:
    """Compare with SBX, the like of Stable-Baselines3 in JAX, one core each."""
    contenders = partial(project, algorithm), partial(script, algorithm, "sbx")
    ours, peer = (partial(on_one_core, contender) for contender in contenders)
    return compare_apart(f"{algorithm}_vs_sbx", "env-steps/s", ours, peer, REPEATS)


def on_one_core(contender: Contender) -> Callable[[], float]:
    """Set up a contender in a process that has one core, before JAX counts them."""
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    return contender()


def project(algorithm: str) -> Callable[[], float]:
    """Start the project's training of an agent with the article's settings, on one thread."""
    use_portable_kernels()
    steps = STEPS[algorithm]
    changes: dict[str, Any] = {"log_interval": steps}
    if algorithm == "dqn":
        changes |= PAST_EXPLORATION
    agent = article_agent(algorithm).model_copy(update=changes)
    events = trainer.train(Job(default_world(), agent, seed=0))
    for _ in range(WARM_UP[algorithm]):
        next(events)
    return lambda: rate(partial(next, events), steps)


def script(
    algorithm: str, library: str = "stable_baselines3", num_threads: int | None = None
) -> Callable[[], float]:
    """Start the article's script for an agent.

    Args:
        algorithm: `dqn` or `sac`.
        library: Stable-Baselines3, or a package with its interface and defaults.
        num_threads: Threads of torch; by default its own choice, every core.
    """
    if num_threads is not None:
        torch.set_num_threads(num_threads)
    agent = article_agent(algorithm)
    env: ArticleAnt | Commanded = ArticleAnt()
    changes: dict[str, Any] = {"policy_kwargs": {"net_arch": list(agent.net_arch)}}
    if algorithm == "dqn":
        env = Commanded(env, ActionSet.of(agent.actions, default_world().env.commands))
        changes |= {"target_update_interval": agent.target_update_interval, **PAST_EXPLORATION}
    else:
        changes |= {"ent_coef": agent.ent_coef}
    learner = getattr(importlib.import_module(library), algorithm.upper())
    model = learner("MlpPolicy", env, learning_rate=agent.learning_rate, seed=0, **changes)
    steps = STEPS[algorithm]
    model.learn(steps * WARM_UP[algorithm])
    return lambda: rate(partial(model.learn, steps, reset_num_timesteps=False), steps)


dqn_vs_sb3, sac_vs_sb3 = partial(versus_sb3, "dqn"), partial(versus_sb3, "sac")
dqn_vs_sbx, sac_vs_sbx = partial(versus_sbx, "dqn"), partial(versus_sbx, "sac")
