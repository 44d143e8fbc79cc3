"""EvoTorch's searchers, built from an agent's settings."""

from jumping_ant.agents.evolution.algorithms import GaussianParams, PGPEParams, SNESParams
from jumping_ant.agents.evolution.library import PGPE, SNES, Problem


def pgpe(problem: Problem, agent: PGPEParams) -> PGPE:
    """Return policy gradients with parameter-based exploration, with the ClipUp optimiser.

    Sehnke et al. 2010, "Parameter-exploring policy gradients"; ClipUp is from Toklu et al. 2020.
    """
    clipup = {"max_speed": agent.max_speed, "momentum": agent.momentum}
    return PGPE(problem, **_common(agent), optimizer="clipup", optimizer_config=clipup)


def snes(problem: Problem, agent: SNESParams) -> SNES:
    """Return separable natural evolution strategies.

    Schaul, Glasmachers and Schmidhuber 2011, "High dimensions and heavy tails for natural evolution
    strategies". EvoTorch multiplies the width's learning rate by that paper's default.
    """
    return SNES(problem, **_common(agent))


def _common(agent: GaussianParams) -> dict[str, float]:
    return {
        "popsize": agent.population_size,
        "center_learning_rate": agent.center_learning_rate,
        "stdev_learning_rate": agent.stdev_learning_rate,
        "stdev_init": agent.stdev_init,
    }
