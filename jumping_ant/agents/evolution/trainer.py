"""PGPE with ClipUp: evolution of a linear policy, on EvoTorch.

Policy gradients with parameter-based exploration (Sehnke et al. 2010, "Parameter-exploring policy
gradients") with the ClipUp optimiser (Toklu et al. 2020).
"""

from collections.abc import Callable, Iterator

import numpy as np
import torch
from evotorch.algorithms import PGPE

from jumping_ant.agents.events import Checkpoint, Event, Finished, Progress, Snapshot
from jumping_ant.agents.evolution import state
from jumping_ant.agents.evolution.problem import JumpProblem
from jumping_ant.params.models import EnvParams, PGPEParams


def train(
    xml: str,
    env: EnvParams,
    agent: PGPEParams,
    seed: int,
    evaluations: int,
    num_threads: int = 1,
    checkpoint: bytes | None = None,
    is_checkpoint_due: Callable[[], bool] = lambda: False,
) -> Iterator[Event]:
    """Evolve a linear policy; a row of the curve is a generation.

    Args:
        xml: The robot as MJCF text.
        env: The task.
        agent: The agent's block.
        seed: Determines the run.
        evaluations: Number of snapshots, spread evenly over the budget.
        num_threads: Threads that step the simulations; results do not depend on it.
        checkpoint: Where to resume from, as an earlier call yielded it.
        is_checkpoint_due: Asked after every generation.

    Yields:
        Progress (with the best return, fitnesses, the centre's norm and the mean stdev), snapshots
        of the centre's policy, checkpoints when due, and at last that policy.
    """
    problem = JumpProblem(xml, env, agent, seed, num_threads)
    searcher = PGPE(
        problem,
        popsize=agent.population_size,
        center_learning_rate=agent.center_learning_rate,
        stdev_learning_rate=agent.stdev_learning_rate,
        stdev_init=agent.stdev_init,
        optimizer="clipup",
        optimizer_config={"max_speed": agent.max_speed, "momentum": agent.momentum},
    )
    if checkpoint is not None:
        state.restore(searcher, problem, checkpoint)
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
        if generation * evaluations % agent.generations < evaluations:
            yield Snapshot(problem.env_steps, _policy_file(searcher, problem))
        if is_checkpoint_due():
            yield Checkpoint(problem.env_steps, state.capture(searcher, problem))
    yield Finished(problem.env_steps, _policy_file(searcher, problem))


def _policy_file(searcher: PGPE, problem: JumpProblem) -> bytes:
    """Return the policy at the distribution's centre, as a policy file."""
    status = (searcher.status[name].as_subclass(torch.Tensor) for name in ("center", "stdev"))
    return problem.policy(*status).to_bytes()
