"""EvoTorch's searches and its normaliser, made resumable.

Resuming needs names that EvoTorch keeps private, those with an underscore. They are in this module
only, and are those of version 0.6.1.
"""

from typing import Any

import torch
from evotorch import SolutionBatch
from evotorch.neuroevolution.net import RunningNorm
from torch import Tensor


def plain(tensor: Tensor) -> Tensor:
    """Return a plain tensor; EvoTorch's own class checks every operation for writes."""
    return tensor.as_subclass(Tensor)


class Gaussian:
    """A search of EvoTorch whose distribution is a Gaussian, with each with an update rule."""

    def __init__(self, search: Any) -> None:
        self._search = search

    @property
    def generation(self) -> int:
        """Number of generations so far."""
        return int(self._search.step_count)

    def step(self) -> None:
        """Sample and evaluate a generation, and improve the distribution."""
        self._search.step()

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
        tensors = {"values": population.values, "evals": population.evals}
        numbers = self._search._distribution.parameters.items()
        tensors |= {name: value for name, value in numbers if isinstance(value, Tensor)}
        if optimizer is not None:
            tensors["velocity"] = optimizer._velocity
        arrays = {name: plain(tensor).numpy() for name, tensor in tensors.items()}
        return {"generation": self.generation, **arrays}

    def load_state(self, state: dict[str, Any]) -> None:
        """Restore a state from `save_state` of a search created with the same settings."""
        search, arrays = self._search, dict(state)
        search._steps_count, search._first_iter = arrays.pop("generation"), False
        tensors = {name: torch.from_numpy(array) for name, array in arrays.items()}
        values, evals = tensors.pop("values"), tensors.pop("evals")
        search._population = SolutionBatch(search.problem, popsize=len(values), empty=True)
        search._population.access_values()[:] = values
        search._population.set_evals(evals)
        if search.optimizer is not None:
            search.optimizer._velocity = tensors.pop("velocity")
        search._distribution = search._distribution.modified_copy(**tensors)


class CovarianceMatrix(Gaussian):
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
        arrays = {name: plain(getattr(self._search, name)).numpy() for name in self.TENSORS}
        return {"generation": self.generation, **arrays}

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
