"""How an agent's training speeds up with threads, measured on this machine.

The policies of a generation run independently of one another, so more threads run more of them at
once. Off-policy learners update one policy: threads share the stepping of their environments, and
each matrix product of a gradient step.

The timed unit is each seed's second row of the learning curve: a generation, or some rounds of
rollouts and updates. Later rows take as long.
"""

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.events import Progress
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.base import machine
from jumping_ant.experiment import scaling_table
from jumping_ant.sim.world import World

REPEATS = 2  # the faster one counts: disturbances only add time


def measure(
    world: World, agent: AgentBlock, seeds: Sequence[int], cores: int | None = None
) -> list[dict[str, Any]]:
    """Time a unit of an agent's training on one or more threads, at most as many as cores.

    The rows have `scaling_table.COLUMNS`; there are none if no claim compares the algorithm's
    speed-up.
    """
    timed = scaling_table.timed(agent)
    if timed is None:
        return []
    unit = partial(_time_row, world, timed)
    counts = list(scaling_table.thread_counts(cores or machine.num_cores()))
    return [
        {"seed": seed, "threads": threads, "seconds": round(seconds, scaling_table.DIGITS)}
        for seed in seeds
        for threads, seconds in _fastest(unit, seed, counts).items()
    ]


def _fastest(
    unit: Callable[[int, int], float], seed: int, counts: Sequence[int]
) -> dict[int, float]:
    """Return the shortest time of a seed's unit [s] by number of threads, measured in turn."""
    fastest = dict.fromkeys(counts, float("inf"))
    for _ in range(REPEATS):
        for threads in counts:
            fastest[threads] = min(fastest[threads], unit(seed, threads))
    return fastest


def _time_row(world: World, agent: AgentBlock, seed: int, threads: int) -> float:
    """Return the seconds of the second row of a seed's learning curve."""
    from threadpoolctl import threadpool_limits  # slow to import, and not for agents without a row

    train = trainer_of(agent)  # which limits the threads, so it comes first
    with threadpool_limits(threads, user_api="blas"):
        events = train(Job(world, agent, seed, num_threads=threads))
        rows = (event for event in events if isinstance(event, Progress))
        next(rows)  # not timed: random actions and memory allocation
        started = time.perf_counter()
        next(rows)
        return time.perf_counter() - started
