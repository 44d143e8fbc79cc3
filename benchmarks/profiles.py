"""Where the time goes, compared with the floor that no change of ours can lower.

The floor is `mj_step` for the same control steps, and the matrix products of the networks.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from mujoco.batch import Batch

from benchmarks import evolution, off_policy, simulation
from benchmarks.apart import apart
from benchmarks.settings import article_agent, default_world
from jumping_ant.actions import ActionSet
from jumping_ant.agents.off_policy.lean.learners import LeanDQN, LeanSAC
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.sim import rollout

FLOOR_ENVS = 16
EPISODES, EPISODE_STEPS = 10, 200  # evaluated


@dataclass(frozen=True)
class Profile:
    """Microseconds of a control step of one robot, on one thread.

    Attributes:
        work: What is done, with the article's settings.
        total: All of it.
        physics: Time in MuJoCo's batch.
        mj_step: Time of MuJoCo alone, with random torques.
        learning: Time in gradient steps.
        products: Time in the matrix products of networks that learn, which NumPy computes (see
            `jumping_ant.agents.kernels`).
    """

    work: str
    total: float
    physics: float
    mj_step: float
    learning: float
    products: float


def profiles() -> Iterator[Profile]:
    """Profile every kind of work, each in a process of its own."""
    with apart(partial(simulation.raw, default_world(), FLOOR_ENVS, np.arange(FLOOR_ENVS))) as turn:
        seconds = min(turn()[0] for _ in range(3))
    mj_step = seconds * 1e6 / simulation.ENV_STEPS
    for contender in (dqn, sac, pgpe, evaluation):
        with apart(partial(contender, mj_step)) as turn:
            yield turn()[0]


def dqn(mj_step: float) -> Callable[[], Profile]:
    """Set up DQN's training."""
    train = off_policy.project("dqn")
    return partial(_profile, "DQN", mj_step, train, off_policy.STEPS["dqn"], LeanDQN)


def sac(mj_step: float) -> Callable[[], Profile]:
    """Set up SAC's training."""
    train = off_policy.project("sac")
    return partial(_profile, "SAC", mj_step, train, off_policy.STEPS["sac"], LeanSAC)


def pgpe(mj_step: float) -> Callable[[], Profile]:
    """Set up PGPE's training."""
    agent = article_agent("pgpe")
    steps = evolution.GENERATIONS * agent.population_size * agent.episode_steps
    return partial(_profile, "PGPE", mj_step, evolution.project(1), steps)


def evaluation(mj_step: float) -> Callable[[], Profile]:
    """Set up parallel episodes of a linear policy, as the `evaluate` stage runs them."""
    weight = np.random.default_rng(0).normal(0, 0.2, (8, 27)).astype(np.float32)
    zeros, ones = np.zeros(27, np.float32), np.ones(27, np.float32)
    policy = LinearPolicy(weight, zeros[:8], zeros, ones, weight, zeros[:8], ActionSet())
    whole = default_world()
    short = whole.env.model_copy(update={"max_episode_steps": EPISODE_STEPS})
    run = partial(rollout.run, replace(whole, env=short), policy, range(EPISODES))
    return partial(_profile, "evaluation", mj_step, run, EPISODES * EPISODE_STEPS)


def _profile(
    work: str,
    mj_step: float,
    train: Callable[[], Any],
    steps: int,
    learner: type | None = None,
) -> Profile:
    """Profile one call.

    Args:
        work: See `Profile`.
        mj_step: See `Profile`.
        train: The function to call.
        steps: Control steps per call.
        learner: The class whose `train` takes the gradient steps, if any.
    """
    with ExitStack() as stack:
        physics = stack.enter_context(_timed(Batch, "step"))
        learning = stack.enter_context(_timed(learner, "train")) if learner else []
        products = stack.enter_context(_timed(np, "matmul"))
        started = time.perf_counter()
        train()
        total = time.perf_counter() - started
    return Profile(
        work,
        total=total * 1e6 / steps,
        physics=sum(physics) * 1e6 / steps,
        mj_step=mj_step,
        learning=sum(learning) * 1e6 / steps,
        products=sum(products) * 1e6 / steps,
    )


@contextmanager
def _timed(owner: Any, name: str) -> Iterator[list[float]]:
    """Time all calls of a method or function, and yield the list that collects their seconds."""
    original = getattr(owner, name)
    seconds: list[float] = []

    def timed(*args: Any, **kwargs: Any) -> Any:
        started = time.perf_counter()
        try:
            return original(*args, **kwargs)
        finally:
            seconds.append(time.perf_counter() - started)

    setattr(owner, name, timed)
    try:
        yield seconds
    finally:
        setattr(owner, name, original)
