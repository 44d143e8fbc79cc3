"""Searchers of all evolutionary algorithms, built from an agent's settings.

A searcher improves a search distribution over linear policies, one generation a step. All but
augmented random search are EvoTorch's.
"""

from dataclasses import dataclass
from typing import Any

import torch

from jumping_ant.agents.catalogue import row
from jumping_ant.agents.evolution.algorithms import EvolutionParams
from jumping_ant.agents.evolution.library import (
    CMAES,
    PGPE,
    CovarianceMatrix,
    Gaussian,
    Problem,
    SolutionBatch,
    plain,
)
from jumping_ant.agents.job import resolve

MIN_DEVIATION = 1e-6  # of the returns that augmented random search divides by


@dataclass
class AugmentedRandomSearch:
    """Random search along the best of a few directions.

    Mania, Guy and Recht 2018, "Simple random search of static linear policies is competitive for
    reinforcement learning", algorithm 2: version V2-t if observations are normalised, else V1-t.
    """

    problem: Problem  # its random generator draws the directions
    popsize: int  # twice the number of directions
    learning_rate: float  # before it is divided by the deviation of the best returns
    delta_std: float  # standard deviation of the directions
    n_top: int  # number of the best directions, which a step follows
    generation: int = 0

    def __post_init__(self) -> None:
        self.center = torch.zeros(self.problem.solution_length)  # that is searched around
        self.spread = torch.full_like(self.center, self.delta_std)  # of the directions

    def step(self) -> None:
        """Evaluate mirrored pairs of policies, and move along the best directions."""
        directions = torch.randn(
            self.popsize // 2, len(self.center), generator=self.problem.generator
        )
        moves = self.delta_std * directions
        batch = SolutionBatch(self.problem, popsize=self.popsize, empty=True)
        batch.access_values()[:] = torch.cat([self.center + moves, self.center - moves])
        self.problem.evaluate(batch)
        forward, backward = plain(batch.evals)[:, 0].chunk(2)
        best = torch.maximum(forward, backward).topk(self.n_top).indices
        forward, backward = forward[best], backward[best]
        deviation = torch.cat([forward, backward]).std(correction=0).clamp(min=MIN_DEVIATION)
        ascent = (forward - backward) @ directions[best]
        self.center = self.center + self.learning_rate / (self.n_top * deviation) * ascent
        self.generation += 1

    def save_state(self) -> dict[str, Any]:
        """Return the centre; the problem keeps the random generator."""
        return {"generation": self.generation, "center": self.center.numpy()}

    def load_state(self, state: dict[str, Any]) -> None:
        """Restore a state from `save_state` of a search created with the same settings."""
        self.generation = state["generation"]
        self.center = torch.from_numpy(state["center"])


Searcher = Gaussian | CovarianceMatrix | AugmentedRandomSearch


def pgpe(problem: Problem, *, max_speed: float, momentum: float, **settings: Any) -> PGPE:
    """Return EvoTorch's PGPE with the ClipUp optimiser (Toklu et al. 2020)."""
    clipup = {"max_speed": max_speed, "momentum": momentum}
    return PGPE(problem, optimizer="clipup", optimizer_config=clipup, **settings)


def make_searcher(problem: Problem, agent: EvolutionParams) -> Searcher:
    """Return an agent's searcher at its start; its algorithm's own settings are passed by name."""
    shared = EvolutionParams.model_fields
    own = [name for name in type(agent).model_fields if name not in shared]
    settings = {name: getattr(agent, name) for name in own}
    search = resolve(row(agent).learner)(problem, popsize=agent.population_size, **settings)
    if isinstance(search, CMAES):
        return CovarianceMatrix(search)
    return search if isinstance(search, AugmentedRandomSearch) else Gaussian(search)
