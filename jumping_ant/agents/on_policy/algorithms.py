"""On-policy algorithms of Stable-Baselines3: their settings and learners."""

from functools import partial
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator

from jumping_ant.agents.algorithm import TORQUES, Algorithm, settings
from jumping_ant.agents.ranges import Between, OneOf, Ranges, whole
from jumping_ant.agents.sb3.settings import EPISODE_RANGES, SB3Params
from jumping_ant.params.blocks import Count, Fraction, NonNegative, Positive


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
    ROUND: ClassVar[str] = "n_steps"

    @model_validator(mode="after")
    def _advantages_can_be_normalised(self) -> Self:
        if self.normalize_advantage and self.round_size < 2:
            raise ValueError("normalize_advantage needs rounds of two decisions or more")
        return self


@settings("a2c", learning_rate=7e-4, n_steps=5, gae_lambda=1.0, normalize_advantage=False)
class A2CParams(OnPolicyParams):
    """Advantage actor-critic, synchronous, with RMSprop (Mnih et al. 2016)."""

    rms_prop_eps: Positive = 1e-5
    """[-] Added to RMSprop's denominators."""


@settings("ppo")
class PPOParams(OnPolicyParams):
    """Proximal policy optimisation, with clipping (Schulman et al. 2017)."""

    batch_size: Annotated[int, Field(ge=2, le=10**6)] = 64
    """[transitions] Batch size of a gradient step."""
    n_epochs: Count = 10
    """[-] Passes over a round's experience."""
    clip_range: Annotated[float, Field(gt=0, le=1)] = 0.2
    """[-] Limit of the change of an action's probability, as a share."""

    @model_validator(mode="after")
    def _batches_divide_a_round(self) -> Self:
        if self.round_size % self.batch_size:
            raise ValueError(
                f"batch_size is {self.batch_size}, but a round of num_envs x n_steps has "
                f"{self.round_size} transitions, which it must divide"
            )
        return self


_RANGES: Ranges = {
    **EPISODE_RANGES,
    "learning_rate": Between(1e-4, 5e-3),
    "gamma": Between(0.85, 0.995, is_log=False),
    "net_arch": OneOf(([64, 64], [128, 128], [256, 256])),
    "gae_lambda": Between(0.8, 1.0, is_log=False),
    "vf_coef": Between(1e-4, 0.5),
    "log_std_init": Between(-1.5, 0.0, is_log=False),
    "max_grad_norm": Between(0.1, 5.0),
    "velocity_scale": Between(0.03, 0.3),
}
_row = partial(
    Algorithm,
    family="on-policy actor-critic",
    trainer="jumping_ant.agents.sb3.trainer",
    example={
        "actions": TORQUES,
        "total_steps": 1536,
        "num_envs": 4,
        "n_steps": 64,
        "log_interval": 768,
    },
)
ALGORITHMS = {
    "a2c": _row(
        A2CParams,
        learner="stable_baselines3:A2C",
        logged=("train/policy_loss", "train/value_loss", "train/entropy_loss"),
        ranges={
            **_RANGES,
            "n_steps": OneOf((4, 5, 8, 16, 32)),
            "normalize_advantage": OneOf((True, False)),
        },
    ),
    "ppo": _row(
        PPOParams,
        learner="stable_baselines3:PPO",
        logged=(
            *("train/policy_gradient_loss", "train/value_loss", "train/entropy_loss"),
            *("train/approx_kl", "train/clip_fraction"),
        ),
        # Batches must divide a round; with the environments of presets/families these do.
        ranges={
            **_RANGES,
            "n_steps": OneOf((8, 16, 32, 64)),
            "batch_size": OneOf((64, 128, 256)),
            "n_epochs": whole(3, 20),
            "clip_range": Between(0.1, 0.4, is_log=False),
        },
    ),
}
