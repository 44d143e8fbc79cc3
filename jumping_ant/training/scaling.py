"""What training takes on this machine, by the number of threads: short pieces of all learners.

Learners are timed by turns and several times each, so that other work on the machine slows all of
them alike. More threads run more policies of a generation at once. Off-policy learners update one
policy: threads share the stepping of their environments, and each matrix product of a gradient
step.

A piece is the second row of a learning curve. Later rows take as long.
"""

import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.events import Progress
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.base import machine, tables
from jumping_ant.params.model import Params
from jumping_ant.sim import robot
from jumping_ant.sim.world import World

REPEATS = 8  # of each piece
DIGITS = 6  # of the seconds


class Piece(NamedTuple):
    """A piece of training, and what it took."""

    agent: str
    repeat: int  # which also is its seed
    threads: int
    env_steps: int  # control steps
    seconds: float  # by the clock
    cpu_seconds: float  # of all threads together


def measure_all(root: Path, params: Params) -> list[Piece]:
    """Time the agents whose algorithms have pieces, in a process that does nothing else."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(measure, root, params, machine.num_cores()).result()


def to_csv(pieces: Sequence[Piece]) -> str:
    """Return a table of pieces."""
    return tables.to_csv([piece._asdict() for piece in pieces], Piece._fields)


def measure(root: Path, params: Params, cores: int) -> list[Piece]:
    """Time pieces on 1, 2, 4, ... threads, at most as many as cores."""
    timed = {name: agent.for_timing() for name, agent in params.agents.items()}
    worlds = {
        kind: World(robot.read(root, kind), params.env)
        for kind in sorted({agent.robot for agent in timed.values() if agent})
    }
    counts = sorted({min(2**power, cores) for power in range(cores.bit_length() + 1)})
    return [
        _timed(worlds[agent.robot], name, agent, repeat, threads)
        for repeat in range(REPEATS)
        for name, agent in timed.items()
        if agent
        for threads in counts
    ]


def _timed(world: World, name: str, agent: AgentBlock, repeat: int, threads: int) -> Piece:
    from threadpoolctl import threadpool_limits

    from jumping_ant.agents.kernels import use_portable_kernels

    use_portable_kernels()  # which limits the threads, so it comes first
    train = trainer_of(agent)
    with threadpool_limits(threads, user_api="blas"):
        events = train(Job(world, agent, repeat, num_threads=threads))
        rows = (event for event in events if isinstance(event, Progress))
        first = next(rows)  # not timed: random actions and memory allocation
        started, spent = time.perf_counter(), time.process_time()
        second = next(rows)
        seconds, cpu = time.perf_counter() - started, time.process_time() - spent
    steps = second.env_steps - first.env_steps
    return Piece(name, repeat, threads, steps, round(seconds, DIGITS), round(cpu, DIGITS))
