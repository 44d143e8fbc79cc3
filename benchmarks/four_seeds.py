"""The article's whole comparison: four seeds here, one seed in its script.

Neither is run to its end. The seconds are projected from rates: each learner's budget divided by
the rate at which it consumes it.
"""

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks import evolution, off_policy
from benchmarks.apart import apart
from benchmarks.measure import Row, compare
from benchmarks.settings import CORES, article_agent

SEEDS = 4
REPEATS = 3

Contender = Callable[[], Callable[[], float]]


def article_four_seeds_vs_script() -> Row:
    """Compare the seconds of training.

    Here each seed has one core, and as many seeds run at a time as there are cores, all of which
    are busy while measured. The script has all cores for its one seed, and trains one agent after
    the other.
    """
    workers = min(CORES, SEEDS)
    rounds = math.ceil(SEEDS / workers)
    seconds, script_seconds = np.zeros(REPEATS), np.zeros(REPEATS)
    for budget, ours, script in _learners():
        with apart(*[ours] * workers) as own, apart(script) as other:
            for repeat in range(REPEATS):
                seconds[repeat] += rounds * budget / min(own())
                script_seconds[repeat] += budget / other()[0]
    return compare(
        "article_four_seeds_vs_script",
        "s",
        partial(next, iter(seconds.tolist())),
        partial(next, iter(script_seconds.tolist())),
        REPEATS,
    )


def _learners() -> list[tuple[int, Contender, Contender]]:
    """Return each learner's budget, the project's training of it and the script's."""
    return [
        (
            article_agent("dqn").total_steps,
            partial(off_policy.project, "dqn"),
            partial(off_policy.script, "dqn"),
        ),
        (
            article_agent("sac").total_steps,
            partial(off_policy.project, "sac"),
            partial(off_policy.script, "sac"),
        ),
        (article_agent("pgpe").generations, partial(evolution.project, 1), evolution.gymne),
    ]
