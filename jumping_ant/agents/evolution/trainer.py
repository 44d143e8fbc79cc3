"""Evolution of a linear policy, on EvoTorch."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import torch

from jumping_ant.agents.catalogue import row
from jumping_ant.agents.events import Checkpoint, Event, Finished, Progress, Snapshot
from jumping_ant.agents.evolution import state
from jumping_ant.agents.evolution.algorithms import EvolutionParams
from jumping_ant.agents.evolution.library import GaussianSearchAlgorithm
from jumping_ant.agents.evolution.problem import JumpProblem
from jumping_ant.agents.job import Job, resolve


def train(job: Job[EvolutionParams]) -> Iterator[Event]:
    """Evolve a linear policy; each row of the curve is a generation.

    Yields:
        Progress (with the best return, fitnesses, the centre's norm and the mean stdev), snapshots
        of the centre's policy, checkpoints when due, and finally that policy.
    """
    agent = job.agent
    problem = JumpProblem(job.xml, job.env, agent, job.seed, job.num_threads)
    searcher: Any = resolve(row(agent).learner)(problem, agent)
    if job.checkpoint is not None:
        state.restore(searcher, problem, job.checkpoint)
    while searcher.step_count < agent.generations:
        searcher.step()
        generation, center = searcher.step_count, searcher.status["center"]
        yield Progress(
            env_steps=problem.env_steps,
            updates=generation,
            episodes=generation * agent.population_size,
            return_mean=float(problem.returns.mean()),
            return_std=float(problem.returns.std()),
            extra={
                "return_best": float(problem.returns.max()),
                "fitness_mean": float(problem.fitness.mean()),
                "fitness_median": float(np.median(problem.fitness)),
                "fitness_best": float(problem.fitness.max()),
                "center_norm": float(center.norm()),
                "stdev_mean": float(searcher.status["stdev"].mean()),
            },
        )
        if generation * job.evaluations % agent.generations < job.evaluations:
            yield Snapshot(problem.env_steps, _policy_bytes(searcher, problem))
        if job.is_checkpoint_due():
            yield Checkpoint(problem.env_steps, state.capture(searcher, problem))
    yield Finished(problem.env_steps, _policy_bytes(searcher, problem))


def _policy_bytes(searcher: GaussianSearchAlgorithm, problem: JumpProblem) -> bytes:
    """Return the policy at the distribution's centre, as a policy file."""
    status = (searcher.status[name].as_subclass(torch.Tensor) for name in ("center", "stdev"))
    return problem.policy(*status).to_bytes()
