"""How an agent's training speeds up with threads, measured on this machine.

A generation plays all of its policies independently of one another, so more threads play more of
them at once. Off-policy learners update one policy: more threads step their environments, and share
out each matrix product of a gradient step.

What is timed is each seed's second row of the learning curve: a generation, or some rounds of
experience and updates. Later ones take as long.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.events import Progress
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.base import machine
from jumping_ant.params.blocks import EnvParams

COLUMNS = ("seed", "threads", "seconds")
REPEATS = 2  # of which the faster counts: what disturbs a measurement only adds to it


def measure(
    xml: str, env: EnvParams, agent: AgentBlock, seeds: Sequence[int], cores: int | None = None
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
    timed = agent.for_timing()
    if timed is None:
        return []
    unit = partial(_time_row, xml, env, timed)
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


def _time_row(xml: str, env: EnvParams, agent: AgentBlock, seed: int, threads: int) -> float:
    """Return the seconds of the second row of a seed's learning curve."""
    import torch  # takes seconds that agents without a row need not wait for

    torch.set_num_threads(threads)
    events = trainer_of(agent)(Job(xml, env, agent, seed, num_threads=threads))
    rows = (event for event in events if isinstance(event, Progress))
    next(rows)  # begins with random actions, and allocates memory
    started = time.perf_counter()
    next(rows)
    seconds = time.perf_counter() - started
    torch.set_num_threads(machine.BLAS_THREADS)
    return seconds
