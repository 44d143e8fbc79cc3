"""The table of how an agent's training speeds up with threads, `scaling.csv`."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.base import tables
from jumping_ant.base.paths import Paths
from jumping_ant.base.tables import SEED, Column
from jumping_ant.experiment.models import Params

DIGITS = 6  # of the seconds
REPETITIONS = 8  # of the timing, each with a seed of its own
COLUMNS = {
    "seed": SEED,
    "threads": Column(low=1, high=1e6, is_whole=True),
    "seconds": Column(low=10.0**-DIGITS, high=1e9),
}
ALGORITHMS = ("dqn", "sac", "pgpe")  # those of the claim on threads (docs/measures-and-claims.md)


def to_csv(agent: str, rows: Sequence[dict[str, Any]]) -> str:
    """Return the content of an agent's `scaling.csv`, from rows of `COLUMNS`."""
    return tables.to_csv([{"agent": agent} | row for row in rows], ["agent", *COLUMNS])


def read(root: Path, params: Params, agent: str) -> dict[int, NDArray[np.float64]]:
    """Read the seconds of a training unit, (n,), by number of threads; {} if not timed."""
    path, stage = Paths(root).agent(agent).scaling, f"scaling@{agent}"
    is_timed = timed(params.agent(agent)) is not None
    table = tables.read(path, stage, {"agent": agent}, COLUMNS, has_rows=is_timed)
    if not is_timed:
        return {}
    counts = list(thread_counts(int(table["threads"].max())))
    with tables.blamed(path, stage):
        asked = [(seed, threads) for threads in counts for seed in seeds(params)]
        seconds = tables.exactly(table, asked, "seed", "threads")["seconds"]
    return dict(zip(counts, seconds.reshape(len(counts), -1), strict=True))


def timed(agent: AgentBlock) -> AgentBlock | None:
    """Return settings that make each row one unit; None if no claim compares the speed-up."""
    return agent.for_timing() if agent.algorithm in ALGORITHMS else None


def seeds(params: Params) -> tuple[int, ...]:
    """Return the seeds whose training is timed."""
    return tuple(params.seeds[:REPETITIONS])


def thread_counts(cores: int) -> Iterator[int]:
    """Yield powers of two below the number of cores, and that number."""
    threads = 1
    while threads < cores:
        yield threads
        threads *= 2
    yield cores
