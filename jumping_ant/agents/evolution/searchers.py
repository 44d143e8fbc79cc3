"""Searchers of all evolutionary algorithms, built from an agent's settings.

A searcher improves a search distribution over linear policies, one generation a step. All but
augmented random search are EvoTorch's.
"""

from abc import ABC, abstractmethod
from typing import Any

import torch
from torch import Tensor

from jumping_ant.agents.evolution.algorithms import (
    ARSParams,
    CEMParams,
    CMAESParams,
    GaussianParams,
    PGPEParams,
    SNESParams,
    XNESParams,
)
from jumping_ant.agents.evolution.library import (
    CEM,
    CMAES,
    PGPE,
    SNES,
    XNES,
    GaussianSearchAlgorithm,
    Problem,
    SolutionBatch,
)

MIN_DEVIATION = 1e-6  # of the returns that augmented random search divides by


class Searcher(ABC):
    """A search distribution over solutions of a problem, and how it is improved."""

    @property
    @abstractmethod
    def generation(self) -> int:
        """Number of generations so far."""

    @property
    @abstractmethod
    def center(self) -> Tensor:
        """Centre of the distribution, shape (solution_length,)."""

    @property
    @abstractmethod
    def spread(self) -> Tensor:
        """Standard deviation of each number of a solution, shape (solution_length,)."""

    @abstractmethod
    def step(self) -> None:
        """Sample and evaluate a generation, and improve the distribution."""

    @abstractmethod
    def save_state(self) -> dict[str, Any]:
        """Return the state after a generation: arrays and JSON-compatible values."""

    @abstractmethod
    def load_state(self, state: dict[str, Any]) -> None:
        """Restore a state from `save_state` of a searcher created with the same parameters."""


class EvoTorchSearcher(Searcher):
    """A searcher of EvoTorch.

    Args:
        searcher: EvoTorch's.
    """

    def __init__(self, searcher: Any) -> None:
        self._searcher = searcher

    @property
    def generation(self) -> int:
        """Number of generations so far."""
        return int(self._searcher.step_count)

    def step(self) -> None:
        """Sample and evaluate a generation, and improve the distribution."""
        self._searcher.step()


class Gaussian(EvoTorchSearcher):
    """A search distribution that is a Gaussian, with its own update rule."""

    _searcher: GaussianSearchAlgorithm

    @property
    def center(self) -> Tensor:
        """Centre of the distribution, shape (solution_length,)."""
        return _plain(self._searcher._distribution.parameters["mu"])

    @property
    def spread(self) -> Tensor:
        """Standard deviation of each number of a solution, shape (solution_length,)."""
        sigma = _plain(self._searcher._distribution.parameters["sigma"])
        # A matrix is a square root of the covariance.
        return sigma if sigma.ndim == 1 else sigma.square().sum(0).sqrt()

    def save_state(self) -> dict[str, Any]:
        """Return last generation, distribution and the optimiser's velocity."""
        population = self._searcher.population
        optimizer = self._searcher.optimizer
        return {
            "generation": self.generation,
            "population": _plain(population.values).numpy(),
            "evals": _plain(population.evals).numpy(),
            "distribution": {
                name: _plain(value).numpy()
                for name, value in self._searcher._distribution.parameters.items()
                if isinstance(value, Tensor)
            },
            "velocity": None if optimizer is None else _plain(optimizer._velocity).numpy(),
        }

    def load_state(self, state: dict[str, Any]) -> None:
        """Restore a state from `save_state` of a searcher created with the same parameters."""
        searcher = self._searcher
        values = torch.from_numpy(state["population"])
        population = SolutionBatch(searcher.problem, popsize=len(values), empty=True)
        population.access_values()[:] = values
        population.set_evals(torch.from_numpy(state["evals"]))
        searcher._population = population
        searcher._first_iter = False
        searcher._steps_count = state["generation"]
        tensors = {name: torch.from_numpy(value) for name, value in state["distribution"].items()}
        searcher._distribution = searcher._distribution.modified_copy(**tensors)
        if searcher.optimizer is not None:
            searcher.optimizer._velocity = torch.from_numpy(state["velocity"])


class CovarianceMatrix(EvoTorchSearcher):
    """The distribution of CMA-ES, and its evolution paths."""

    TENSORS = ("m", "sigma", "C", "A", "p_sigma", "p_c")

    _searcher: CMAES

    @property
    def center(self) -> Tensor:
        """Centre of the distribution, shape (solution_length,)."""
        return _plain(self._searcher.m)

    @property
    def spread(self) -> Tensor:
        """Standard deviation of each number of a solution, shape (solution_length,)."""
        shape = _plain(self._searcher.C)
        variances = shape if shape.ndim == 1 else shape.diagonal()
        return _plain(self._searcher.sigma) * variances.sqrt()

    def save_state(self) -> dict[str, Any]:
        """Return the distribution and its paths."""
        tensors = {name: _plain(getattr(self._searcher, name)).numpy() for name in self.TENSORS}
        return {"generation": self.generation, **tensors}

    def load_state(self, state: dict[str, Any]) -> None:
        """Restore a state from `save_state` of a searcher created with the same parameters."""
        self._searcher._steps_count = state["generation"]
        for name in self.TENSORS:
            setattr(self._searcher, name, torch.from_numpy(state[name]))


class AugmentedRandomSearch(Searcher):
    """Random search along the best of a few directions.

    Mania, Guy and Recht 2018, "Simple random search of static linear policies is competitive for
    reinforcement learning", algorithm 2: version V2-t if observations are normalised, else V1-t.

    Args:
        problem: The problem.
        agent: The agent's block.
    """

    def __init__(self, problem: Problem, agent: ARSParams) -> None:
        self._problem = problem
        self._agent = agent
        self._center = torch.zeros(problem.solution_length)
        self._generation = 0

    @property
    def generation(self) -> int:
        """Number of generations so far."""
        return self._generation

    @property
    def center(self) -> Tensor:
        """The policy that is searched around, shape (solution_length,)."""
        return self._center

    @property
    def spread(self) -> Tensor:
        """Standard deviation of the directions, shape (solution_length,)."""
        return torch.full_like(self._center, self._agent.delta_std)

    def step(self) -> None:
        """Evaluate mirrored pairs of policies, and move along the best directions."""
        agent = self._agent
        directions = torch.randn(
            agent.population_size // 2, len(self._center), generator=self._problem.generator
        )
        moves = agent.delta_std * directions
        batch = SolutionBatch(self._problem, popsize=agent.population_size, empty=True)
        batch.access_values()[:] = torch.cat([self._center + moves, self._center - moves])
        self._problem.evaluate(batch)
        forward, backward = _plain(batch.evals)[:, 0].chunk(2)
        best = torch.maximum(forward, backward).topk(agent.n_top).indices
        forward, backward = forward[best], backward[best]
        deviation = torch.cat([forward, backward]).std(correction=0).clamp(min=MIN_DEVIATION)
        ascent = (forward - backward) @ directions[best]
        self._center = self._center + agent.learning_rate / (agent.n_top * deviation) * ascent
        self._generation += 1

    def save_state(self) -> dict[str, Any]:
        """Return the centre; the problem keeps the random generator."""
        return {"generation": self._generation, "center": self._center.numpy()}

    def load_state(self, state: dict[str, Any]) -> None:
        """Restore a state from `save_state` of a searcher created with the same parameters."""
        self._generation = state["generation"]
        self._center = torch.from_numpy(state["center"])


def pgpe(problem: Problem, agent: PGPEParams) -> Searcher:
    """Return policy gradients with parameter-based exploration, with the ClipUp optimiser.

    Sehnke et al. 2010, "Parameter-exploring policy gradients"; ClipUp is from Toklu et al. 2020.
    """
    clipup = {"max_speed": agent.max_speed, "momentum": agent.momentum}
    return Gaussian(PGPE(problem, **_common(agent), optimizer="clipup", optimizer_config=clipup))


def snes(problem: Problem, agent: SNESParams) -> Searcher:
    """Return separable natural evolution strategies.

    Schaul, Glasmachers and Schmidhuber 2011, "High dimensions and heavy tails for natural evolution
    strategies". EvoTorch multiplies the width's learning rate by that paper's default.
    """
    return Gaussian(SNES(problem, **_common(agent)))


def xnes(problem: Problem, agent: XNESParams) -> Searcher:
    """Return exponential natural evolution strategies, with a full covariance matrix.

    Glasmachers et al. 2010, "Exponential natural evolution strategies". EvoTorch multiplies the
    width's learning rate by that paper's default.
    """
    return Gaussian(XNES(problem, **_common(agent)))


def cem(problem: Problem, agent: CEMParams) -> Searcher:
    """Return the cross-entropy method.

    Rubinstein 1999, "The cross-entropy method for combinatorial and continuous optimization".
    """
    return Gaussian(
        CEM(
            problem,
            popsize=agent.population_size,
            parenthood_ratio=agent.parenthood_ratio,
            stdev_init=agent.stdev_init,
        )
    )


def cmaes(problem: Problem, agent: CMAESParams) -> Searcher:
    """Return the covariance matrix adaptation evolution strategy.

    Hansen and Ostermeier 2001, "Completely derandomized self-adaptation in evolution strategies".
    """
    return CovarianceMatrix(
        CMAES(
            problem,
            popsize=agent.population_size,
            stdev_init=agent.stdev_init,
            separable=agent.separable,
        )
    )


def _common(agent: GaussianParams) -> dict[str, float]:
    return {
        "popsize": agent.population_size,
        "center_learning_rate": agent.center_learning_rate,
        "stdev_learning_rate": agent.stdev_learning_rate,
        "stdev_init": agent.stdev_init,
    }


def _plain(tensor: Tensor) -> Tensor:
    """Return a plain tensor; EvoTorch's own class checks every operation for writes."""
    return tensor.as_subclass(Tensor)
