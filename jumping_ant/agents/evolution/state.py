"""State that a search resumes from: last generation, distribution, optimiser and problem."""

import numpy as np
import torch
from numpy.typing import NDArray

from jumping_ant.agents.evolution.library import GaussianSearchAlgorithm, SolutionBatch
from jumping_ant.agents.evolution.problem import JumpProblem
from jumping_ant.base.archive import pack_state, unpack_state


def capture(searcher: GaussianSearchAlgorithm, problem: JumpProblem) -> bytes:
    """Return the state of a search after a generation."""
    population = searcher.population
    return pack_state(
        {
            "generation": searcher.step_count,
            "population": population.values.as_subclass(torch.Tensor).numpy(),
            "evals": population.evals.as_subclass(torch.Tensor).numpy(),
            "mu": searcher.status["center"].as_subclass(torch.Tensor).numpy(),
            "sigma": searcher.status["stdev"].as_subclass(torch.Tensor).numpy(),
            "velocity": _velocity(searcher),
            "problem": problem.save_state(),
        }
    )


def restore(searcher: GaussianSearchAlgorithm, problem: JumpProblem, content: bytes) -> None:
    """Put a fresh search into a captured state.

    Args:
        searcher: A searcher created with the same parameters.
        problem: Its problem.
        content: What `capture` returned.
    """
    state = unpack_state(content)
    tensors = {
        name: torch.from_numpy(state[name]) for name in ("population", "evals", "mu", "sigma")
    }
    population = SolutionBatch(problem, popsize=len(tensors["population"]), empty=True)
    population.access_values()[:] = tensors["population"]
    population.set_evals(tensors["evals"])
    searcher._population = population
    searcher._first_iter = False
    searcher._steps_count = state["generation"]
    searcher._distribution = searcher._distribution.modified_copy(
        mu=tensors["mu"], sigma=tensors["sigma"]
    )
    if searcher.optimizer is not None:
        searcher.optimizer._velocity = torch.from_numpy(state["velocity"])
    problem.load_state(state["problem"])


def _velocity(searcher: GaussianSearchAlgorithm) -> NDArray[np.float32] | None:
    """Return ClipUp's velocity, None if there is no optimiser."""
    if searcher.optimizer is None:
        return None
    velocity: NDArray[np.float32] = searcher.optimizer._velocity.as_subclass(torch.Tensor).numpy()
    return velocity
