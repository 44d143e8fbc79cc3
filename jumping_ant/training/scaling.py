"""How an agent's training speeds up with threads, measured on this machine.

A generation of PGPE plays all of its policies independently of one another, so more threads play
more of them at once. DQN and SAC update one policy: more threads step their environments, and share
out each matrix product of a gradient step.

What is timed is each seed's first generation, or its first rounds of experience and updates; later
ones take as long.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

from jumping_ant.base import machine
from jumping_ant.params.models import AgentParams, DQNParams, EnvParams, PGPEParams, SACParams

COLUMNS = ("seed", "threads", "seconds")
REPEATS = 2  # of which the faster counts: what disturbs a measurement only adds to it
GRADIENT_STEPS = 64  # of DQN and SAC that are timed


def measure(
    xml: str, env: EnvParams, agent: AgentParams, seeds: Sequence[int], cores: int | None = None
) -> list[dict[str, Any]]:
    """Time a unit of an agent's training on one thread and more, up to all cores.

    Args:
        xml: The robot as MJCF text.
        env: The task.
        agent: The agent's block.
        seeds: Its seeds.
        cores: Threads at most; by default all that this process may use.

    Returns:
        Rows of `COLUMNS`: the seconds that it took with so many threads. There are none for an
        agent that does not train.
    """
    unit: Callable[[int, int], float]
    if isinstance(agent, PGPEParams):
        unit = partial(_time_generation, xml, env, agent)
    elif isinstance(agent, DQNParams | SACParams):
        unit = partial(_time_rounds, xml, env, agent)
    else:
        return []
    counts = list(_thread_counts(cores or machine.num_cores()))
    return [
        {"seed": seed, "threads": threads, "seconds": round(seconds, 6)}
        for seed in seeds
        for threads, seconds in _fastest(unit, seed, counts).items()
    ]


def _thread_counts(cores: int) -> Iterator[int]:
    """Yield powers of two below the number of cores, and that number."""
    threads = 1
    while threads < cores:
        yield threads
        threads *= 2
    yield cores


def _fastest(
    unit: Callable[[int, int], float], seed: int, counts: Sequence[int]
) -> dict[int, float]:
    """Return the seconds of a seed's unit by number of threads, measured in turn."""
    fastest = dict.fromkeys(counts, float("inf"))
    for _ in range(REPEATS):
        for threads in counts:
            fastest[threads] = min(fastest[threads], unit(seed, threads))
    return fastest


def _time_generation(xml: str, env: EnvParams, agent: PGPEParams, seed: int, threads: int) -> float:
    """Return the seconds of a seed's first generation."""
    import torch  # with EvoTorch, takes seconds that other agents need not wait for

    from jumping_ant.agents.evolution.problem import JumpProblem

    torch.set_num_threads(machine.BLAS_THREADS)
    problem = JumpProblem(xml, env, agent, seed, threads)
    batch = problem.generate_batch(agent.population_size)
    started = time.perf_counter()
    problem.evaluate(batch)
    return time.perf_counter() - started


def _time_rounds(
    xml: str, env: EnvParams, agent: DQNParams | SACParams, seed: int, threads: int
) -> float:
    """Return the seconds of a seed's first rounds with gradient steps."""
    import torch

    from jumping_ant.agents.off_policy import trainer

    torch.set_num_threads(threads)
    round_size = agent.num_envs * agent.train_freq
    rounds = -(-GRADIENT_STEPS // agent.gradient_steps)
    # The first row of the curve ends with the first updates, the second one is timed.
    timed = agent.model_copy(
        update={
            "learning_starts": round_size,
            "log_interval": rounds * round_size,
            "total_steps": 4 * rounds * round_size * agent.actions.hold,
        }
    )
    events = trainer.train(xml, env, timed, seed, 1, threads)
    next(events)
    started = time.perf_counter()
    next(events)
    seconds = time.perf_counter() - started
    torch.set_num_threads(machine.BLAS_THREADS)
    return seconds
