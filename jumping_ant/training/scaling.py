"""How an agent's training speeds up with threads, measured on this machine.

The policies of a generation run independently of one another, so more threads run more of them at
once. Off-policy learners update one policy: threads share the stepping of their environments, and
each matrix product of a gradient step.

The timed unit is each seed's second row of the learning curve: a generation, or some rounds of
rollouts and updates. Later rows take as long.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.events import Progress
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.base import machine, tables
from jumping_ant.base.paths import Paths
from jumping_ant.base.tables import SEED, Column
from jumping_ant.experiment.models import Params
from jumping_ant.sim.world import World

DIGITS = 6  # of the seconds
COLUMNS = {
    "seed": SEED,
    "threads": Column(low=1, high=1e6, is_whole=True),
    "seconds": Column(low=10.0**-DIGITS, high=1e9),
}
ALGORITHMS = ("dqn", "sac", "pgpe")  # those of the claim on threads (docs/claims.md)
REPEATS = 2  # the faster one counts: disturbances only add time


def measure(
    world: World, agent: AgentBlock, seeds: Sequence[int], cores: int | None = None
) -> list[dict[str, Any]]:
    """Time a unit of an agent's training on one or more threads.

    There are at most as many threads as cores, by default all that this process may use.

    Returns:
        Rows of `COLUMNS`: the seconds that it took with each number of threads; empty for an agent
        whose algorithm's speed-up no claim compares.
    """
    timed = _timed(agent)
    if timed is None:
        return []
    unit = partial(_time_row, world, timed)
    counts = list(_thread_counts(cores or machine.num_cores()))
    return [
        {"seed": seed, "threads": threads, "seconds": round(seconds, DIGITS)}
        for seed in seeds
        for threads, seconds in _fastest(unit, seed, counts).items()
    ]


def to_csv(agent: str, rows: Sequence[dict[str, Any]]) -> str:
    """Return the content of an agent's `scaling.csv`, from what `measure` returns."""
    return tables.to_csv([{"agent": agent} | row for row in rows], ["agent", *COLUMNS])


def read(root: Path, params: Params, agent: str) -> dict[int, NDArray[np.float64]]:
    """Read the seconds of each seed's unit of training, by number of threads.

    Returns:
        Seconds of shape (num_seeds,) for each number of threads, from 1 on; empty for an agent
        whose algorithm's speed-up no claim compares.

    Raises:
        InputError: The file is missing, malformed, or does not have each seed and number once.
    """
    path, stage = Paths(root).agent(agent).scaling, f"scaling@{agent}"
    is_timed = _timed(params.agent(agent)) is not None
    table = tables.read(path, stage, {"agent": agent}, COLUMNS, has_rows=is_timed)
    if not is_timed:
        return {}
    counts = list(_thread_counts(int(table["threads"].max())))
    with tables.blamed(path, stage):
        asked = [(seed, threads) for threads in counts for seed in params.seeds]
        seconds = tables.exactly(table, asked, "seed", "threads")["seconds"]
    return dict(zip(counts, seconds.reshape(len(counts), -1), strict=True))


def _timed(agent: AgentBlock) -> AgentBlock | None:
    """Return settings that make each row one unit; None if no claim compares the speed-up."""
    return agent.for_timing() if agent.algorithm in ALGORITHMS else None


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
    """Return the shortest time of a seed's unit [s] by number of threads, measured in turn."""
    fastest = dict.fromkeys(counts, float("inf"))
    for _ in range(REPEATS):
        for threads in counts:
            fastest[threads] = min(fastest[threads], unit(seed, threads))
    return fastest


def _time_row(world: World, agent: AgentBlock, seed: int, threads: int) -> float:
    """Return the seconds of the second row of a seed's learning curve."""
    import torch  # slow to import, and not needed for agents without a row

    torch.set_num_threads(threads)
    events = trainer_of(agent)(Job(world, agent, seed, num_threads=threads))
    rows = (event for event in events if isinstance(event, Progress))
    next(rows)  # not timed: random actions and memory allocation
    started = time.perf_counter()
    next(rows)
    seconds = time.perf_counter() - started
    torch.set_num_threads(machine.BLAS_THREADS)
    return seconds
