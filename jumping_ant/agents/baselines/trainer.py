"""The baselines: random actions, and the best open-loop rhythm.

An open loop is a metronome that ignores the state: it cycles through a few commands, by default all
feet down and all feet up, and holds each for the same number of control steps. Its training only
tries a handful of rhythms. A learner that does not achieve a higher return has not learned to use
its observations: see Raffin et al. 2024, "An open-loop baseline for reinforcement learning
locomotion tasks", whose oscillators are another agent (`oscillator`).
"""

from collections.abc import Iterator
from dataclasses import replace
from pkgutil import resolve_name
from typing import Any

import numpy as np

from jumping_ant.agents.baselines.algorithms import OpenLoopParams, RandomAgentParams
from jumping_ant.agents.catalogue import row
from jumping_ant.agents.events import Event, Finished, Progress, Snapshot
from jumping_ant.agents.job import Job
from jumping_ant.base.seeding import derive_all
from jumping_ant.params.blocks import EnvParams
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.blind import OpenLoopPolicy, UniformPolicy
from jumping_ant.sim import rollout


def train(job: Job[Any]) -> Iterator[Event]:
    """Yield one snapshot at the end, and no checkpoints: this takes seconds."""
    yield from resolve_name(row(job.agent).learner)(job)


def draw(job: Job[RandomAgentParams]) -> Iterator[Event]:
    """Yield the policy that draws its actions at random, without any training."""
    actions = ActionSet.of(job.agent.actions, job.world.env.commands)
    policy = UniformPolicy(job.seed, actions, job.world.anatomy.num_motors).to_bytes()
    yield Snapshot(0, policy)
    yield Finished(0, policy)


def search(job: Job[OpenLoopParams]) -> Iterator[Event]:
    """Try each rhythm on the same start states, and keep the one with the highest mean return."""
    agent, env = job.agent, job.world.env
    task = env.model_copy(update={"max_episode_steps": agent.episode_steps})
    world = replace(job.world, env=task)
    starts = derive_all(job.seed, "starts", agent.episodes)
    best, best_return, env_steps = b"", -np.inf, 0
    for number, half_period in enumerate(agent.half_periods, start=1):
        policy = metronome(agent, env, half_period)
        rewards = [each.rewards for each in rollout.run(world, policy, starts, job.num_threads)]
        env_steps += sum(map(len, rewards))
        returns = np.array([np.cumsum(each)[-1] for each in rewards])  # added one by one
        if returns.mean() > best_return:
            best, best_return = policy.to_bytes(), returns.mean()
        yield Progress(
            env_steps=env_steps,
            updates=number,
            episodes=number * agent.episodes,
            return_mean=float(returns.mean()),
            return_std=float(returns.std()),
            extra={"half_period": float(half_period)},
        )
    yield Snapshot(env_steps, best)
    yield Finished(env_steps, best)


def metronome(agent: OpenLoopParams, env: EnvParams, half_period: int) -> OpenLoopPolicy:
    """Return the policy that holds each of an agent's commands for `half_period` control steps."""
    table = np.float32(agent.amplitude) * np.array(env.commands, dtype=np.float32)[agent.commands]
    return OpenLoopPolicy(ActionSet(table, hold=half_period))
