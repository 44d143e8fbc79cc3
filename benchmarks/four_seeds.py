"""The article's whole comparison: four seeds here, one seed in its script.

Neither is run to its end. The seconds are projected from rates: each learner's budget divided by
the rate at which it consumes it.
"""

import math
from collections.abc import Iterator
from functools import partial

import numpy as np

from benchmarks import evolution, off_policy
from benchmarks.article_ant import article_agent
from benchmarks.measure import CORES, Contender, Row, apart, row

SEEDS = 4
REPEATS = 3


def article_four_seeds_vs_script() -> Row:
    """Compare the seconds of training.

    Here each seed has one core, and as many seeds run at a time as there are cores, all of which
    are busy while measured. The script has all cores for its one seed, and trains one agent after
    the other.
    """
    workers = min(CORES, SEEDS)
    rounds = math.ceil(SEEDS / workers)
    seconds = np.zeros((REPEATS, 2))
    for budget, ours, script in _learners():
        with apart(*[ours] * workers) as own, apart(script) as other:
            for repeat in range(REPEATS):
                seconds[repeat] += rounds * budget / min(own()), budget / other()[0]
    return row("article_four_seeds_vs_script", "s", seconds.tolist())


def _learners() -> Iterator[tuple[int, Contender, Contender]]:
    """Yield each learner's budget, the project's training of it and the script's."""
    for name in ("dqn", "sac"):
        ours, script = partial(off_policy.project, name), partial(off_policy.script, name)
        yield article_agent(name).total_steps, ours, script
    yield article_agent("pgpe").generations, partial(evolution.project, 1), evolution.gymne
