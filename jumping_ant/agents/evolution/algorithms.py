"""Evolutionary algorithms, most of them EvoTorch's: settings and searchers."""

from functools import partial
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from jumping_ant.agents.algorithm import TORQUES, AgentBlock, Algorithm, settings
from jumping_ant.agents.ranges import Between, OneOf, Ranges, whole
from jumping_ant.params.blocks import ActionParams, Count, Fraction, NonNegative, Number, Positive

Width = Annotated[float, Field(ge=1e-6, le=100)]  # in the float32 of a search


class EvolutionParams(AgentBlock):
    """Settings shared by the evolutionary algorithms.

    An algorithm's further settings are named as in EvoTorch, to which they are passed.
    """

    actions: ActionParams
    """Actions that the policies choose from."""
    generations: Count
    """[-] Training budget of a seed."""
    population_size: Annotated[int, Field(ge=2, le=10**6)]
    """[policies] Size of a generation."""
    episode_steps: Count
    """[control steps] Length of the episode that evaluates a policy."""
    decrease_rewards_by: Number = 0.0
    """[1/step] Subtracted from the reward of every control step survived."""
    observation_normalization: bool = False
    """Whether observations are normalised by their running statistics."""

    @property
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps], if no episode ends early."""
        return self.generations * self.population_size * self.episode_steps

    def for_timing(self) -> Self:
        """Return settings of two generations; each row of the curve is a generation anyway."""
        return self.model_copy(update={"generations": 2})


class GaussianParams(EvolutionParams):
    """Settings of a search distribution with a separate width for each parameter."""

    center_learning_rate: Positive
    """[-] Learning rate of the distribution's centre; with ClipUp, the length of a step."""
    stdev_learning_rate: Annotated[float, Field(ge=0, le=10)]
    """[-] Learning rate of the distribution's width; SNES and XNES scale it by their default."""
    stdev_init: Width
    """[-] Initial width of the distribution."""


@settings("pgpe")
class PGPEParams(GaussianParams):
    """Policy gradients with parameter-based exploration (Sehnke et al. 2010), with ClipUp."""

    population_size: Annotated[int, Field(ge=2, le=10**6, multiple_of=2)]
    """[policies] Size of a generation, sampled in mirrored pairs."""
    max_speed: Positive
    """[-] Maximum step length of the centre."""
    momentum: Fraction = 0.9
    """[-] Momentum of ClipUp."""


@settings("snes")
class SNESParams(GaussianParams):
    """Separable natural evolution strategies (Schaul, Glasmachers and Schmidhuber 2011)."""


@settings("xnes")
class XNESParams(GaussianParams):
    """Exponential natural evolution strategies, full covariance (Glasmachers et al. 2010)."""


@settings("cem")
class CEMParams(EvolutionParams):
    """Cross-entropy method (Rubinstein 1999)."""

    parenthood_ratio: Annotated[float, Field(gt=0, lt=1)]
    """[-] Share of a generation that the next distribution is fitted to."""
    stdev_init: Width
    """[-] Initial width of the distribution."""

    @model_validator(mode="after")
    def _there_are_two_parents(self) -> Self:
        if self.parenthood_ratio * self.population_size < 2:
            raise ValueError(
                f"parenthood_ratio is {self.parenthood_ratio}, but a distribution is fitted to two "
                f"policies or more, {2 / self.population_size} of population_size"
            )
        return self


@settings("cmaes")
class CMAESParams(EvolutionParams):
    """Covariance matrix adaptation evolution strategy (Hansen and Ostermeier 2001)."""

    stdev_init: Width
    """[-] Initial step size."""
    separable: bool = False
    """Whether the covariance matrix is diagonal."""


@settings("oscillator")
class OscillatorParams(CMAESParams):
    """Oscillators that ignore observations, tuned by CMA-ES (Raffin et al. 2024)."""

    frequency: Positive
    """[Hz] Frequency of the oscillators at the start of the search."""
    observation_normalization: Literal[False] = False
    """Nothing is normalised: oscillators ignore observations."""


@settings("ars")
class ARSParams(EvolutionParams):
    """Augmented random search (Mania, Guy and Recht 2018), named as in SB3-Contrib."""

    population_size: Annotated[int, Field(ge=2, le=10**6, multiple_of=2)]
    """[policies] Size of a generation, in mirrored pairs: twice the number of directions."""
    learning_rate: Positive = 0.02
    """[-] Step size, before it is divided by the deviation of the best returns."""
    delta_std: Width = 0.05
    """[-] Standard deviation of the directions."""
    n_top: Count
    """[-] Number of directions, the best, that a step follows."""

    @model_validator(mode="after")
    def _there_are_so_many_directions(self) -> Self:
        if self.n_top > self.population_size // 2:
            raise ValueError(
                f"n_top is {self.n_top}, but population_size has {self.population_size // 2} "
                "directions"
            )
        return self


@settings("openai-es")
class OpenAIESParams(EvolutionParams):
    """OpenAI's evolution strategy (Salimans et al. 2017), with its authors' defaults."""

    population_size: Annotated[int, Field(ge=2, le=10**6, multiple_of=2)]
    """[policies] Size of a generation, in mirrored pairs."""
    learning_rate: Positive = 0.01
    """[-] Learning rate of Adam, which moves the centre."""
    noise_stdev: Width = 0.02
    """[-] Standard deviation of the policies around the centre."""
    weight_decay: NonNegative = 0.005
    """[-] Factor on the centre that is subtracted from the gradient."""


_SEARCHERS = "jumping_ant.agents.evolution.searchers"
# Generations follow from the population and the episodes, so that all spend the same control steps.
_POPULATIONS: Ranges = {
    "population_size": OneOf((10, 16, 20, 30, 40)),
    "episode_steps": OneOf((100, 200, 300, 400)),
}
_WIDTHS: Ranges = {**_POPULATIONS, "stdev_init": Between(0.03, 1.0)}
_RATES: Ranges = {
    **_WIDTHS,
    "center_learning_rate": Between(0.3, 3.0),
    "stdev_learning_rate": Between(0.03, 3.0),
}
_SEPARABLE: Ranges = {**_WIDTHS, "separable": OneOf((True, False))}
_SHORT = {"actions": TORQUES, "generations": 3, "population_size": 8, "episode_steps": 30}
_SHORT_WIDTH = _SHORT | {"stdev_init": 0.2}
_SHORT_RATES = _SHORT_WIDTH | {"center_learning_rate": 0.1, "stdev_learning_rate": 0.1}

_row = partial(Algorithm, family="evolution", policy_kind="linear")
ALGORITHMS = {
    "pgpe": _row(
        PGPEParams,
        learner=f"{_SEARCHERS}:pgpe",
        has_best_sample=True,
        ranges={
            **_WIDTHS,
            "center_learning_rate": Between(0.01, 0.3),
            "stdev_learning_rate": Between(0.02, 0.5),
            "max_speed": Between(0.02, 0.5),
            "momentum": Between(0.5, 0.95, is_log=False),
        },
        example=_SHORT_RATES | {"max_speed": 0.2},
    ),
    "snes": _row(
        SNESParams, learner="evotorch.algorithms:SNES", ranges=_RATES, example=_SHORT_RATES
    ),
    "xnes": _row(
        XNESParams, learner="evotorch.algorithms:XNES", ranges=_RATES, example=_SHORT_RATES
    ),
    "cem": _row(
        CEMParams,
        learner="evotorch.algorithms:CEM",
        ranges={**_WIDTHS, "parenthood_ratio": Between(0.2, 0.6, is_log=False)},
        example=_SHORT_WIDTH | {"parenthood_ratio": 0.5},
    ),
    "cmaes": _row(
        CMAESParams,
        learner="evotorch.algorithms:CMAES",
        label="CMA-ES",
        ranges=_SEPARABLE,
        example=_SHORT_WIDTH,
    ),
    "oscillator": _row(
        OscillatorParams,
        learner=f"{_SEARCHERS}:oscillator",
        label="oscillator",
        policy_kind="oscillator",
        ranges={**_SEPARABLE, "frequency": Between(1.0, 6.0)},
        example=_SHORT_WIDTH | {"frequency": 3.0},
    ),
    "ars": _row(
        ARSParams,
        learner=f"{_SEARCHERS}:AugmentedRandomSearch",
        ranges={
            **_POPULATIONS,
            "learning_rate": Between(0.005, 0.3),
            "delta_std": Between(0.03, 1.0),
            "n_top": whole(1, 5),
        },
        example=_SHORT | {"n_top": 2},
    ),
    "openai-es": _row(
        OpenAIESParams,
        learner=f"{_SEARCHERS}:OpenAIES",
        label="OpenAI-ES",
        ranges={
            **_POPULATIONS,
            "learning_rate": Between(0.005, 0.5),
            "noise_stdev": Between(0.02, 1.0),
            "weight_decay": Between(5e-4, 0.05),
        },
        example=_SHORT,
    ),
}
