"""How an agent's training speeds up with threads, measured on this machine.

More threads run more policies of a generation at once. Off-policy learners update one policy:
threads share the stepping of their environments, and each matrix product of a gradient step.

The timed unit is each seed's second row of the learning curve. Later rows take as long.
"""

import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.catalogue import row
from jumping_ant.agents.events import Progress
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.base import machine, tables
from jumping_ant.params.model import Params
from jumping_ant.sim import robot
from jumping_ant.sim.world import World

SEEDS = 8  # whose training is timed: the first ones
REPEATS = 2  # the fastest one counts
DIGITS = 6  # of the seconds

Seconds = dict[int, NDArray[np.float64]]
"""The time of a unit of training [s], (num_seeds,), by number of threads; {} if not timed."""


def measure_all(root: Path, params: Params) -> dict[str, Seconds]:
    """Time each agent, one after the other, in a process that does nothing else."""
    with ProcessPoolExecutor(1, get_context("spawn"), max_tasks_per_child=1) as pool:
        found = pool.map(partial(measure, root, params), params.agents)
        return dict(zip(params.agents, found, strict=True))


def to_csv(scaling: Mapping[str, Seconds], seeds: Sequence[int]) -> str:
    """Return a table of what `measure_all` found, seed by seed."""
    rows = [
        {"agent": agent, "seed": seed, "threads": threads, "seconds": own[i]}
        for agent, seconds in scaling.items()
        for i, seed in enumerate(seeds[:SEEDS])
        for threads, own in seconds.items()
    ]
    return tables.to_csv(rows, ["agent", "seed", "threads", "seconds"])


def measure(root: Path, params: Params, name: str, cores: int | None = None) -> Seconds:
    """Time a unit of an agent's training on 1, 2, 4, ... threads, at most as many as cores.

    Returns {} if no claim compares the algorithm's speed-up.
    """
    agent = params.agent(name)
    timed = agent.for_timing() if row(agent).is_scaled else None
    if timed is None:
        return {}
    world = World(robot.read(root, agent.robot), params.env)
    seeds, most = params.seeds[:SEEDS], cores or machine.num_cores()
    counts = sorted({min(2**power, most) for power in range(most.bit_length() + 1)})
    fastest = np.full((len(seeds), len(counts)), np.inf)
    for own, seed in zip(fastest, seeds, strict=True):
        for _ in range(REPEATS):
            own[:] = np.minimum(own, [_time_row(world, timed, seed, count) for count in counts])
    return dict(zip(counts, fastest.T.round(DIGITS), strict=True))


def _time_row(world: World, agent: AgentBlock, seed: int, threads: int) -> float:
    """Return the seconds of the second row of a seed's learning curve."""
    from threadpoolctl import threadpool_limits

    from jumping_ant.agents.kernels import use_portable_kernels

    use_portable_kernels()  # which limits the threads, so it comes first
    train = trainer_of(agent)
    with threadpool_limits(threads, user_api="blas"):
        events = train(Job(world, agent, seed, num_threads=threads))
        rows = (event for event in events if isinstance(event, Progress))
        next(rows)  # not timed: random actions and memory allocation
        started = time.perf_counter()
        next(rows)
        return time.perf_counter() - started
