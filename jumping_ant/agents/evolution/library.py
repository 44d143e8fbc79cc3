"""EvoTorch, imported without what it can do without.

If MLflow, pandas and `cma` are installed, EvoTorch imports them for loggers and an algorithm that
nobody uses here: two thirds of the time its import takes, in every process.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager

UNUSED = ("cma", "mlflow", "pandas")


@contextmanager
def not_installed(*names: str) -> Iterator[None]:
    """Make imports of packages fail, unless they are imported already."""
    hidden = [name for name in names if name not in sys.modules]
    sys.modules.update(dict.fromkeys(hidden))  # type: ignore[arg-type]  # None: there is no such
    try:
        yield
    finally:
        for name in hidden:
            del sys.modules[name]


with not_installed(*UNUSED):
    from evotorch import Problem, SolutionBatch
    from evotorch.algorithms import CEM, CMAES, PGPE, SNES, XNES
    from evotorch.algorithms.distributed.gaussian import GaussianSearchAlgorithm
    from evotorch.neuroevolution.net import RunningNorm

__all__ = [
    "CEM",
    "CMAES",
    "PGPE",
    "SNES",
    "XNES",
    "GaussianSearchAlgorithm",
    "Problem",
    "RunningNorm",
    "SolutionBatch",
]
