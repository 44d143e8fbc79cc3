"""EvoTorch, imported without what it can do without, and its searches made resumable.

If MLflow, pandas and `cma` are installed, EvoTorch imports them for loggers and an algorithm that
nobody uses here: two thirds of the time its import takes, in every process.

Resuming needs names that EvoTorch keeps private, those with an underscore. They are in this module
only, and are those of version 0.6.1.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import torch
from torch import Tensor

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
    from evotorch.algorithms import CMAES, PGPE
    from evotorch.neuroevolution.net import RunningNorm
    from evotorch.tools.ranking import centered

__all__ = ["CMAES", "PGPE", "Problem", "SolutionBatch", "centered"]


def plain(tensor: Tensor) -> Tensor:
    """Return a plain tensor; EvoTorch's own class checks every operation for writes."""
    return tensor.as_subclass(Tensor)


class _Search:
    """A search of EvoTorch."""

    def __init__(self, search: Any) -> None:
        self._search = search

    @property
    def generation(self) -> int:
        """Number of generations so far."""
        return int(self._search.step_count)

    def step(self) -> None:
        """Sample and evaluate a generation, and improve the distribution."""
        self._search.step()


class Gaussian(_Search):
    """A search distribution that is a Gaussian, with its own update rule."""

    @property
    def center(self) -> Tensor:
        """Centre of the distribution, shape (solution_length,)."""
        return plain(self._search._distribution.parameters["mu"])

    @property
    def spread(self) -> Tensor:
        """Standard deviation of each number of a solution, shape (solution_length,)."""
        sigma = plain(self._search._distribution.parameters["sigma"])
        # A matrix is a square root of the covariance.
        return sigma if sigma.ndim == 1 else sigma.square().sum(0).sqrt()

    def save_state(self) -> dict[str, Any]:
        """Return last generation, distribution and the optimiser's velocity."""
        population, optimizer = self._search.population, self._search.optimizer
        return {
            "generation": self.generation,
            "population": plain(population.values).numpy(),
            "evals": plain(population.evals).numpy(),
            "distribution": {
                name: plain(value).numpy()
                for name, value in self._search._distribution.parameters.items()
                if isinstance(value, Tensor)
            },
            "velocity": None if optimizer is None else plain(optimizer._velocity).numpy(),
        }

    def load_state(self, state: dict[str, Any]) -> None:
        """Restore a state from `save_state` of a search created with the same settings."""
        search = self._search
        values = torch.from_numpy(state["population"])
        population = SolutionBatch(search.problem, popsize=len(values), empty=True)
        population.access_values()[:] = values
        population.set_evals(torch.from_numpy(state["evals"]))
        search._population = population
        search._first_iter = False
        search._steps_count = state["generation"]
        tensors = {name: torch.from_numpy(value) for name, value in state["distribution"].items()}
        search._distribution = search._distribution.modified_copy(**tensors)
        if search.optimizer is not None:
            search.optimizer._velocity = torch.from_numpy(state["velocity"])


class CovarianceMatrix(_Search):
    """The distribution of CMA-ES, and its evolution paths."""

    TENSORS = ("m", "sigma", "C", "A", "p_sigma", "p_c")

    @property
    def center(self) -> Tensor:
        """Centre of the distribution, shape (solution_length,)."""
        return plain(self._search.m)

    @property
    def spread(self) -> Tensor:
        """Standard deviation of each number of a solution, shape (solution_length,)."""
        shape = plain(self._search.C)
        variances = shape if shape.ndim == 1 else shape.diagonal()
        return plain(self._search.sigma) * variances.sqrt()

    def save_state(self) -> dict[str, Any]:
        """Return the distribution and its paths."""
        tensors = {name: plain(getattr(self._search, name)).numpy() for name in self.TENSORS}
        return {"generation": self.generation, **tensors}

    def load_state(self, state: dict[str, Any]) -> None:
        """Restore a state from `save_state` of a search created with the same settings."""
        self._search._steps_count = state["generation"]
        for name in self.TENSORS:
            setattr(self._search, name, torch.from_numpy(state[name]))


class Normalizer(RunningNorm):
    """Running statistics of observations."""

    def save_state(self) -> dict[str, Any]:
        """Return the number of observations and, if there is one, their sums."""
        seen = {"sum": self.sum, "sum_of_squares": self.sum_of_squares} if self.count else {}
        arrays = {name: tensor.numpy() for name, tensor in seen.items()}
        return {"count": self.count, "observations": arrays}

    def load_state(self, state: dict[str, Any]) -> None:
        """Restore a state from `save_state`."""
        self._count = state["count"]
        for name, array in state["observations"].items():
            setattr(self, f"_{name}", torch.from_numpy(array))
