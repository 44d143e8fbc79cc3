"""Searchers of all evolutionary algorithms, built from an agent's settings.

A searcher improves a search distribution over policies, one generation a step. All but augmented
random search and OpenAI's evolution strategy are EvoTorch's.
"""

import math
from abc import abstractmethod
from dataclasses import dataclass, field
from pkgutil import resolve_name
from typing import Any, ClassVar

import torch
from evotorch import Problem, SolutionBatch
from evotorch.algorithms import CMAES, PGPE
from evotorch.tools.ranking import centered
from torch import Tensor

from jumping_ant.agents.catalogue import row
from jumping_ant.agents.evolution.algorithms import EvolutionParams
from jumping_ant.agents.evolution.library import CovarianceMatrix, Gaussian, plain

MIN_DEVIATION = 1e-6  # of the returns that augmented random search divides by
ADAM_BETAS, ADAM_EPSILON = (0.9, 0.999), 1e-8


@dataclass
class MirroredSearch:
    """A search around a centre by mirrored pairs of policies, with a fixed width."""

    problem: Problem  # its random generator draws the directions
    popsize: int  # twice the number of directions
    generation: int = field(default=0, init=False)
    center: Tensor = field(init=False)  # that is searched around

    WIDTH: ClassVar[str]  # the setting that is the standard deviation of a solution's numbers
    TENSORS: ClassVar[tuple[str, ...]] = ("center",)  # that later generations depend on

    def __post_init__(self) -> None:
        self.center = torch.zeros(self.problem.solution_length)

    @property
    def spread(self) -> Tensor:
        """Standard deviation of each number of a solution, shape (solution_length,)."""
        return torch.full_like(self.center, getattr(self, self.WIDTH))

    def step(self) -> None:
        """Evaluate mirrored pairs of policies, and move the centre."""
        directions = torch.randn(
            self.popsize // 2, len(self.center), generator=self.problem.generator
        )
        moves = self.spread * directions
        batch = SolutionBatch(self.problem, popsize=self.popsize, empty=True)
        batch.access_values()[:] = torch.cat([self.center + moves, self.center - moves])
        self.problem.evaluate(batch)
        self.generation += 1
        self._move(directions, plain(batch.evals)[:, 0])

    @abstractmethod
    def _move(self, directions: Tensor, fitness: Tensor) -> None:
        """Move the centre, by the fitness of the policies ahead and then of those behind."""

    def save_state(self) -> dict[str, Any]:
        """Return what later generations depend on; the problem keeps the random generator."""
        arrays = {name: getattr(self, name).numpy() for name in self.TENSORS}
        return {"generation": self.generation, **arrays}

    def load_state(self, state: dict[str, Any]) -> None:
        """Restore a state from `save_state` of a search created with the same settings."""
        self.generation = state["generation"]
        for name in self.TENSORS:
            setattr(self, name, torch.from_numpy(state[name]))


@dataclass
class AugmentedRandomSearch(MirroredSearch):
    """Random search along the best of a few directions.

    Mania, Guy and Recht 2018, "Simple random search of static linear policies is competitive for
    reinforcement learning", algorithm 2: version V2-t if observations are normalised, else V1-t.
    """

    learning_rate: float  # before it is divided by the deviation of the best returns
    delta_std: float  # standard deviation of the directions
    n_top: int  # number of the best directions, which a step follows

    WIDTH = "delta_std"

    def _move(self, directions: Tensor, fitness: Tensor) -> None:
        forward, backward = fitness.chunk(2)
        best = torch.maximum(forward, backward).topk(self.n_top).indices
        forward, backward = forward[best], backward[best]
        deviation = torch.cat([forward, backward]).std(correction=0).clamp(min=MIN_DEVIATION)
        ascent = (forward - backward) @ directions[best]
        self.center = self.center + self.learning_rate / (self.n_top * deviation) * ascent


@dataclass
class OpenAIES(MirroredSearch):
    """Evolution along the gradient of ranks, with Adam and weight decay.

    Salimans et al. 2017, "Evolution strategies as a scalable alternative to reinforcement
    learning", algorithm 1 with section 2.1's mirrored sampling, rank-shaped returns and weight
    decay. EvoTorch's PGPE with Adam and a fixed width lacks the decay.
    """

    learning_rate: float  # of Adam
    noise_stdev: float  # standard deviation of the policies around the centre
    weight_decay: float  # factor on the centre that is subtracted from the gradient

    WIDTH = "noise_stdev"
    TENSORS = ("center", "mean", "mean_square")

    def __post_init__(self) -> None:
        super().__post_init__()
        self.mean, self.mean_square = (torch.zeros_like(self.center) for _ in range(2))

    def _move(self, directions: Tensor, fitness: Tensor) -> None:
        forward, backward = centered(fitness).chunk(2)
        slope = (forward - backward) @ directions / (len(fitness) * self.noise_stdev)
        gradient = slope - self.weight_decay * self.center
        first, second = ADAM_BETAS
        self.mean = first * self.mean + (1 - first) * gradient
        self.mean_square = second * self.mean_square + (1 - second) * gradient.square()
        mean = self.mean / (1 - first**self.generation)
        root = (self.mean_square / (1 - second**self.generation)).sqrt()
        self.center = self.center + self.learning_rate * mean / (root + ADAM_EPSILON)


Searcher = Gaussian | MirroredSearch


def pgpe(problem: Problem, *, max_speed: float, momentum: float, **settings: Any) -> PGPE:
    """Return EvoTorch's PGPE with the ClipUp optimiser (Toklu et al. 2020)."""
    clipup = {"max_speed": max_speed, "momentum": momentum}
    return PGPE(problem, optimizer="clipup", optimizer_config=clipup, **settings)


def oscillator(problem: Problem, *, frequency: float, **settings: Any) -> CMAES:
    """Return EvoTorch's CMA-ES, which starts with motors at rest and both frequencies alike."""
    center = torch.zeros(problem.solution_length)
    center[-2:] = math.log2(frequency)
    return CMAES(problem, center_init=center, **settings)


def make_searcher(problem: Problem, agent: EvolutionParams) -> Searcher:
    """Return an agent's searcher at its start; what its algorithm adds is passed by name."""
    names = type(agent).model_fields.keys() - EvolutionParams.model_fields.keys()
    settings = {name: getattr(agent, name) for name in names}
    search = resolve_name(row(agent).learner)(problem, popsize=agent.population_size, **settings)
    if isinstance(search, CMAES):
        return CovarianceMatrix(search)
    return search if isinstance(search, MirroredSearch) else Gaussian(search)
