"""Evolutionary algorithms of EvoTorch: their settings, and how each is built."""

from typing import Annotated, Literal, Self

from pydantic import Field

from jumping_ant.agents.algorithm import AgentBlock, Algorithm
from jumping_ant.params.blocks import Count, Fraction, NonNegative, Positive, TorqueParams


class EvolutionParams(AgentBlock):
    """What evolutionary algorithms have in common, named as in EvoTorch."""

    trainer: Literal["evolution"]
    """Package of jumping_ant/agents/ that trains the agent."""
    actions: TorqueParams
    """What the policies' outputs become: torques."""
    generations: Count
    """[-] Training budget of a seed."""
    population_size: Annotated[int, Field(ge=2)]
    """[policies] In a generation."""
    episode_steps: Count
    """[control steps] That each policy is tried for."""
    decrease_rewards_by: float
    """[1/step] Taken off the reward of every control step survived."""
    observation_normalization: bool
    """Whether observations are normalised by their running statistics."""

    @property
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps], if no episode ends early."""
        return self.generations * self.population_size * self.episode_steps

    def for_timing(self) -> Self:
        """Return settings whose rows of the curve are generations, as they always are."""
        return self.model_copy(update={"generations": 2})


class GaussianParams(EvolutionParams):
    """Settings of a search distribution with a width of its own for each parameter."""

    center_learning_rate: Positive
    """[-] Of the distribution's centre; with ClipUp, the length of a step."""
    stdev_learning_rate: NonNegative
    """[-] Rate at which the distribution's width is learned."""
    stdev_init: Positive
    """[-] Width at the start."""


class PGPEParams(GaussianParams):
    """Policy gradients with parameter-based exploration (Sehnke et al. 2010), with ClipUp."""

    algorithm: Literal["pgpe"]
    """What it trains."""
    population_size: Annotated[int, Field(ge=2, multiple_of=2)]
    """[policies] In a generation, in mirrored pairs."""
    max_speed: Positive
    """[-] Longest step of the centre."""
    momentum: Fraction
    """[-] Of ClipUp."""


class SNESParams(GaussianParams):
    """Separable natural evolution strategies (Schaul, Glasmachers and Schmidhuber 2011)."""

    algorithm: Literal["snes"]
    """What it trains."""


_SEARCHERS = "jumping_ant.agents.evolution.searchers"
ALGORITHMS = {
    "pgpe": Algorithm(PGPEParams, learner=f"{_SEARCHERS}:pgpe"),
    "snes": Algorithm(SNESParams, learner=f"{_SEARCHERS}:snes"),
}
