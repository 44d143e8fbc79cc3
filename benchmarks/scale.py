"""How cost grows with the work; ideally the cost of a step stays flat."""

from collections.abc import Iterator
from functools import partial

from benchmarks import cost, evolution
from benchmarks.apart import apart
from benchmarks.cost import Cost

SIZES = {
    cost.environments: (1, 16, 256, 4096),
    evolution.population: (20, 200, 2000),
}


def costs() -> Iterator[Cost]:
    """Measure every size, each in a process of its own."""
    for contender, sizes in SIZES.items():
        for size in sizes:
            with apart(partial(contender, size)) as measure:
                yield measure()[0]
