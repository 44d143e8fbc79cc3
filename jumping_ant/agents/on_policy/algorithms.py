"""On-policy algorithms of Stable-Baselines3: their settings and learners."""

import operator
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from jumping_ant.agents.algorithm import Algorithm, defaults
from jumping_ant.agents.sb3.settings import SB3Params
from jumping_ant.params.blocks import Count, Fraction, NonNegative, Positive

COPIES = 4  # of a learned number: itself, its gradient and the optimiser's two means


class OnPolicyParams(SB3Params):
    """Settings shared by the on-policy algorithms, named as in Stable-Baselines3.

    A round collects `n_steps` decisions in each environment, learns from them, and drops them.
    """

    n_steps: Count = 2048
    """[decisions of each environment] Length of a round."""
    gae_lambda: Fraction = 0.95
    """[-] Decay of the generalised advantage estimate (Schulman et al. 2016)."""
    ent_coef: NonNegative = 0.0
    """[-] Weight of the policy's entropy in the loss."""
    vf_coef: NonNegative = 0.5
    """[-] Weight of the value function in the loss."""
    max_grad_norm: Positive = 0.5
    """[-] Gradients are clipped to this norm."""
    normalize_advantage: bool = True
    """Whether advantages are normalised in each minibatch."""
    log_std_init: Annotated[float, Field(ge=-20, le=2)] = 0.0
    """[-] Initial logarithm of the torques' standard deviations; commands have none."""

    POLICY_SETTINGS: ClassVar[tuple[str, ...]] = ("net_arch", "log_std_init")

    @property
    def round_steps(self) -> int:
        """Control steps of a round, in all environments."""
        return self.num_envs * self.n_steps * self.actions.hold

    def memory(self, num_observations: int, num_motors: int) -> int:
        """Return about how much memory a seed takes: a round's experience, networks [bytes]."""
        sizes = [num_observations, *self.net_arch, num_motors]
        numbers = 2 * COPIES * sum(map(operator.mul, sizes, sizes[1:]))
        transition = 4 * (num_observations + num_motors + 6)
        return 2 * self.num_envs * self.n_steps * transition + 4 * numbers

    @model_validator(mode="after")
    def _budget_holds_a_round(self) -> Self:
        if self.total_steps < self.round_steps:
            raise ValueError(
                f"total_steps is {self.total_steps}, but one round of num_envs x n_steps x "
                f"actions.hold takes {self.round_steps}"
            )
        return self

    @model_validator(mode="after")
    def _advantages_can_be_normalised(self) -> Self:
        if self.normalize_advantage and self.num_envs * self.n_steps < 2:
            raise ValueError("normalize_advantage needs rounds of two decisions or more")
        return self


@defaults(learning_rate=7e-4, n_steps=5, gae_lambda=1.0, normalize_advantage=False)
class A2CParams(OnPolicyParams):
    """Advantage actor-critic, synchronous, with RMSprop (Mnih et al. 2016)."""

    algorithm: Literal["a2c"]
    """Algorithm of the catalogue."""
    rms_prop_eps: Positive = 1e-5
    """[-] Added to RMSprop's denominators."""


class PPOParams(OnPolicyParams):
    """Proximal policy optimisation, with clipping (Schulman et al. 2017)."""

    algorithm: Literal["ppo"]
    """Algorithm of the catalogue."""
    batch_size: Annotated[int, Field(ge=2, le=10**6)] = 64
    """[transitions] Batch size of a gradient step."""
    n_epochs: Count = 10
    """[-] Passes over a round's experience."""
    clip_range: Annotated[float, Field(gt=0, le=1)] = 0.2
    """[-] Limit of the change of an action's probability, as a share."""

    @model_validator(mode="after")
    def _batches_divide_a_round(self) -> Self:
        if self.num_envs * self.n_steps % self.batch_size:
            raise ValueError(
                f"batch_size is {self.batch_size}, but a round of num_envs x n_steps has "
                f"{self.num_envs * self.n_steps} transitions, which it must divide"
            )
        return self


ALGORITHMS = {
    "a2c": Algorithm(
        A2CParams,
        family="on-policy actor-critic",
        learner="stable_baselines3:A2C",
        logged=("train/policy_loss", "train/value_loss", "train/entropy_loss"),
    ),
    "ppo": Algorithm(
        PPOParams,
        family="on-policy actor-critic",
        learner="stable_baselines3:PPO",
        logged=(
            *("train/policy_gradient_loss", "train/value_loss", "train/entropy_loss"),
            *("train/approx_kl", "train/clip_fraction"),
        ),
    ),
}
