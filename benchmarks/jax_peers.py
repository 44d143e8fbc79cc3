"""DQN and SAC compared with SBX, their Stable-Baselines3-compatible implementations in JAX."""

import os
from collections.abc import Callable
from functools import partial

from benchmarks import off_policy
from benchmarks.apart import compare_apart
from benchmarks.article_ant import ArticleAnt
from benchmarks.measure import Row, rate
from benchmarks.settings import article_agent, task
from jumping_ant.actions import ActionSet
from jumping_ant.sim.env import Decisions


def dqn_vs_sbx() -> Row:
    """Compare DQN, on one core each."""
    return _compare("dqn")


def sac_vs_sbx() -> Row:
    """Compare SAC, on one core each."""
    return _compare("sac")


def _compare(algorithm: str) -> Row:
    ours, peer = partial(_project, algorithm), partial(_sbx, algorithm)
    return compare_apart(f"{algorithm}_vs_sbx", "env-steps/s", ours, peer, off_policy.REPEATS)


def _project(algorithm: str) -> Callable[[], float]:
    _use_one_core()
    return off_policy.project(algorithm)


def _sbx(algorithm: str) -> Callable[[], float]:
    """Start SBX's training of an agent in the article's environment, with the article's settings.

    Where its defaults are not those of Stable-Baselines3, they are replaced by these.
    """
    _use_one_core()  # before JAX counts the cores
    import sbx

    agent = article_agent(algorithm)
    env, nets = ArticleAnt(), {"net_arch": list(agent.net_arch)}
    model: sbx.DQN | sbx.SAC
    if algorithm == "dqn":
        model = sbx.DQN(
            "MlpPolicy",
            Decisions(env, ActionSet.of(agent.actions, task().commands)),
            learning_rate=agent.learning_rate,
            target_update_interval=agent.target_update_interval,
            policy_kwargs=nets,
            seed=0,
            **off_policy.PAST_EXPLORATION,
        )
    else:
        model = sbx.SAC(
            "MlpPolicy",
            env,
            learning_rate=agent.learning_rate,
            ent_coef=agent.ent_coef,
            policy_kwargs=nets,
            seed=0,
        )
    steps = off_policy.STEPS[algorithm]
    model.learn(steps * off_policy.WARM_UP[algorithm])
    return lambda: rate(partial(model.learn, steps, reset_num_timesteps=False), steps)


def _use_one_core() -> None:
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
