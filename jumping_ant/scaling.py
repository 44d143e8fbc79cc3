"""How a population's evaluation speeds up with threads, measured on this machine.

PGPE plays all policies of a generation independently of one another, so more threads play more of
them at once. What is timed is each seed's first generation, which is as long as any later one.
"""

import time
from collections.abc import Iterator, Sequence
from typing import Any

from jumping_ant import machine
from jumping_ant.params import AgentParams, EnvParams, PGPEParams

COLUMNS = ("seed", "threads", "seconds")
REPEATS = 2  # of which the faster counts: what disturbs a measurement only adds to it


def measure(
    xml: str, env: EnvParams, agent: AgentParams, seeds: Sequence[int], cores: int | None = None
) -> list[dict[str, Any]]:
    """Time a generation of an agent on one thread and more, up to all cores.

    Args:
        xml: The robot as MJCF text.
        env: The task.
        agent: The agent's block.
        seeds: Its seeds.
        cores: Threads at most; by default all that this process may use.

    Returns:
        Rows of `COLUMNS`: the seconds that a generation took with so many threads. There are none
        for an agent without a population.
    """
    if not isinstance(agent, PGPEParams):
        return []
    counts = list(_thread_counts(cores or machine.num_cores()))
    return [
        {"seed": seed, "threads": threads, "seconds": round(seconds, 6)}
        for seed in seeds
        for threads, seconds in _time_generation(xml, env, agent, seed, counts).items()
    ]


def _thread_counts(cores: int) -> Iterator[int]:
    """Yield powers of two below the number of cores, and that number."""
    threads = 1
    while threads < cores:
        yield threads
        threads *= 2
    yield cores


def _time_generation(
    xml: str, env: EnvParams, agent: PGPEParams, seed: int, counts: list[int]
) -> dict[int, float]:
    """Return the seconds of a seed's first generation by number of threads, measured in turn."""
    import torch  # with EvoTorch, takes seconds that agents without a population need not wait

    from jumping_ant.agents.evolution.problem import JumpProblem

    torch.set_num_threads(machine.BLAS_THREADS)
    fastest = dict.fromkeys(counts, float("inf"))
    for _ in range(REPEATS):
        for threads in counts:
            problem = JumpProblem(xml, env, agent, seed, threads)
            batch = problem.generate_batch(agent.population_size)
            started = time.perf_counter()
            problem.evaluate(batch)
            fastest[threads] = min(fastest[threads], time.perf_counter() - started)
    return fastest
