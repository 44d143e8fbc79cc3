"""Off-policy algorithms of Stable-Baselines3 and SB3-Contrib: their settings and learners.

A learner is Stable-Baselines3's own class, or one of `jumping_ant.agents.off_policy.lean`, which
computes the same with fewer operations. Settings that are parameters of its constructor are passed
to it by name.
"""

from functools import partial
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from jumping_ant.agents.algorithm import TORQUES, Algorithm, settings
from jumping_ant.agents.ranges import Between, OneOf, Ranges, whole
from jumping_ant.agents.sb3.settings import EPISODE_RANGES, SB3Params
from jumping_ant.params.blocks import (
    CommandParams,
    Count,
    Fraction,
    LevelParams,
    NonNegative,
    Positive,
    Steps,
    TorqueParams,
)

TIMED_UPDATES = 64  # gradient steps per timed unit of work


class OffPolicyParams(SB3Params):
    """Settings shared by the off-policy algorithms, named as in Stable-Baselines3."""

    buffer_size: Annotated[int, Field(ge=1, le=10**9)] = 1_000_000
    """[transitions] Capacity of the replay buffer."""
    learning_starts: Annotated[int, Field(ge=0, le=10**9)] = 100
    """[transitions] Random actions before the first update."""
    batch_size: Count = 256
    """[transitions] Batch size of a gradient step."""
    n_steps: Count = 1
    """[decisions] Number of rewards before the bootstrap."""
    train_freq: Count = 1
    """[decisions of each environment] Interval between rounds of updates."""
    gradient_steps: Count = 1
    """[-] Gradient steps per round of updates."""

    ROUND: ClassVar[str] = "train_freq"

    def for_timing(self) -> Self:
        """Return settings whose rows, from the second on, are a few rounds with updates."""
        row = -(-TIMED_UPDATES // self.gradient_steps) * self.round_size
        steps = {"log_interval": row, "total_steps": 4 * row * self.actions.hold}
        return self.model_copy(update={"learning_starts": self.round_size, **steps})

    @model_validator(mode="after")
    def _budget_exceeds_the_random_start(self) -> "OffPolicyParams":
        random_steps = self.learning_starts * self.actions.hold
        if self.total_steps <= random_steps:
            raise ValueError(
                f"total_steps is {self.total_steps}, but learning_starts x actions.hold takes "
                f"{random_steps}, after which it would begin to learn"
            )
        return self


class TargetParams(OffPolicyParams):
    """Settings of the algorithms that learn towards targets of slower networks."""

    tau: Fraction = 0.005
    """[-] Weight of the online networks in an update of the target networks."""


@settings(batch_size=32, tau=1.0, train_freq=4)
class ValueParams(TargetParams):
    """Settings of the algorithms that learn the values of discrete actions."""

    target_update_interval: Steps = 10_000
    """[transitions] Interval between target updates."""
    exploration_fraction: Annotated[float, Field(gt=0, le=1)] = 0.1
    """[-] Share of the budget over which exploration decays."""
    exploration_initial_eps: Fraction = 1.0
    """[-] Initial probability of a random command, or level of a motor."""
    exploration_final_eps: Fraction = 0.05
    """[-] That probability after the decay."""
    max_grad_norm: Positive = 10.0
    """[-] Gradients are clipped to this norm."""


@settings("dqn", learning_rate=1e-4)
class DQNParams(ValueParams):
    """Deep Q-network on discrete commands (Mnih et al. 2015)."""

    actions: CommandParams
    """Actions that the agent chooses from: commands."""


@settings("decqn", learning_rate=1e-4)
class DecQNParams(ValueParams):
    """Decoupled Q-networks on a few levels for each motor (Seyde et al. 2023)."""

    actions: LevelParams
    """Actions that the agent chooses from: levels of each motor."""


@settings("qrdqn", learning_rate=5e-5, exploration_fraction=0.005, exploration_final_eps=0.01)
class QRDQNParams(ValueParams):
    """Quantile regression deep Q-network on discrete commands (Dabney et al. 2018)."""

    actions: CommandParams
    """Actions that the agent chooses from: commands."""
    n_quantiles: Annotated[int, Field(ge=1, le=10_000)] = 200
    """[-] Quantiles of each command's return."""

    POLICY_SETTINGS: ClassVar[tuple[str, ...]] = ("net_arch", "n_quantiles")


@settings("sac", net_arch=[256, 256])
class SACParams(TargetParams):
    """Soft actor-critic on continuous torques (Haarnoja et al. 2018)."""

    actions: TorqueParams
    """Actions that the agent chooses from: torques."""
    ent_coef: Positive | Literal["auto"] = "auto"
    """[-] Weight of the policy's entropy, or `auto` to learn it."""


@settings("tqc")
class TQCParams(SACParams):
    """Truncated quantile critics on continuous torques (Kuznetsov et al. 2020)."""

    n_quantiles: Annotated[int, Field(ge=1, le=10_000)] = 25
    """[-] Quantiles of each critic."""
    n_critics: Annotated[int, Field(ge=1, le=100)] = 2
    """[-] Number of critics."""
    top_quantiles_to_drop_per_net: Annotated[int, Field(ge=0, le=10_000)] = 2
    """[-] Highest quantiles of each critic that targets leave out."""

    POLICY_SETTINGS: ClassVar[tuple[str, ...]] = ("net_arch", "n_quantiles", "n_critics")

    @model_validator(mode="after")
    def _some_quantiles_are_left(self) -> Self:
        if self.top_quantiles_to_drop_per_net >= self.n_quantiles:
            raise ValueError(
                f"top_quantiles_to_drop_per_net is {self.top_quantiles_to_drop_per_net}, but "
                f"n_quantiles is {self.n_quantiles}, of which some must be left"
            )
        return self


@settings("crossq", learning_rate=1e-3, net_arch=[256, 256])
class CrossQParams(OffPolicyParams):
    """CrossQ on continuous torques: batch renormalisation, no targets (Bhatt et al. 2024)."""

    actions: TorqueParams
    """Actions that the agent chooses from: torques."""
    batch_size: Annotated[int, Field(ge=2, le=10**6)] = 256
    """[transitions] Batch size of a gradient step, whose statistics need two."""
    ent_coef: Positive | Literal["auto"] = "auto"
    """[-] Weight of the policy's entropy, or `auto` to learn it."""
    policy_delay: Count = 3
    """[gradient steps] Critic updates per actor update."""


@settings("ddpg", learning_rate=1e-3, net_arch=[400, 300])
class DDPGParams(TargetParams):
    """Deep deterministic policy gradients on continuous torques (Lillicrap et al. 2016)."""

    actions: TorqueParams
    """Actions that the agent chooses from: torques."""
    action_noise: NonNegative
    """[-] Standard deviation of the Gaussian exploration noise on the torques."""


@settings("td3")
class TD3Params(DDPGParams):
    """Twin delayed deterministic policy gradients on continuous torques (Fujimoto et al. 2018)."""

    policy_delay: Count = 2
    """[gradient steps] Critic updates per actor update."""
    target_policy_noise: NonNegative = 0.2
    """[-] Standard deviation of the noise on the target policy's torques."""
    target_noise_clip: NonNegative = 0.5
    """[-] Limit to which that noise is clipped."""
    n_critics: Annotated[int, Field(ge=1, le=100)] = 2
    """[-] Number of critics; targets are the least of their values."""

    POLICY_SETTINGS: ClassVar[tuple[str, ...]] = ("net_arch", "n_critics")


_RANGES: Ranges = {
    **EPISODE_RANGES,
    "learning_rate": Between(1e-4, 3e-3),
    "gamma": Between(0.85, 0.995, is_log=False),
    "batch_size": OneOf((64, 128, 256, 512)),
    "net_arch": OneOf(([64, 64], [128, 128], [256, 256])),
    "n_steps": whole(1, 4, is_log=False),
    "velocity_scale": Between(0.03, 0.3),
    "learning_starts": whole(250, 2500),
}
_VALUES: Ranges = {
    **_RANGES,
    "gradient_steps": whole(2, 16),
    "target_update_interval": whole(500, 8000),
    "exploration_fraction": Between(0.05, 0.8, is_log=False),
    "exploration_final_eps": Between(0.005, 0.1),
}
_CRITICS: Ranges = {**_RANGES, "gradient_steps": whole(1, 16), "tau": Between(0.002, 0.05)}
_ENTROPY: Ranges = {"ent_coef": Between(0.01, 0.5)}
_DETERMINISTIC: Ranges = {
    **_CRITICS,
    "learning_starts": whole(250, 5000),
    "action_noise": Between(0.03, 1.0),
}
_DELAY: Ranges = {"policy_delay": whole(1, 4, is_log=False)}
_SHORT = {
    "actions": TORQUES,
    "total_steps": 600,
    "num_envs": 4,
    "learning_starts": 100,
    "log_interval": 100,
}
_SHORT_COMMANDS = _SHORT | {"actions": {"kind": "commands", "amplitude": 0.5, "hold": 3}}
_TRAINER = "jumping_ant.agents.sb3.trainer"
_LEAN = "jumping_ant.agents.off_policy.lean.learners"

_values = partial(
    Algorithm,
    family="value-based",
    trainer=_TRAINER,
    logged=("train/loss", "rollout/exploration_rate"),
    ranges=_VALUES,
)
_actor_critic = partial(
    Algorithm,
    family="off-policy actor-critic",
    trainer=_TRAINER,
    logged=("train/actor_loss", "train/critic_loss"),
    example=_SHORT,
)
_entropic = partial(
    _actor_critic, logged=("train/actor_loss", "train/critic_loss", "train/ent_coef")
)
ALGORITHMS = {
    "dqn": _values(DQNParams, learner=f"{_LEAN}:LeanDQN", example=_SHORT_COMMANDS),
    "decqn": _values(
        DecQNParams,
        learner="jumping_ant.agents.off_policy.decqn:DecQN",
        label="DecQN",
        policy_kind="dqn",
        example=_SHORT | {"actions": TORQUES | {"kind": "levels", "levels": 2}},
    ),
    "sac": _entropic(
        SACParams,
        learner=f"{_LEAN}:LeanSAC",
        ranges={**_CRITICS, **_ENTROPY},
    ),
    "qrdqn": _values(
        QRDQNParams, learner="sb3_contrib:QRDQN", label="QR-DQN", example=_SHORT_COMMANDS
    ),
    "tqc": _entropic(
        TQCParams,
        learner="sb3_contrib:TQC",
        ranges={**_CRITICS, **_ENTROPY, "top_quantiles_to_drop_per_net": whole(0, 8, is_log=False)},
    ),
    "crossq": _entropic(
        CrossQParams,
        learner="sb3_contrib:CrossQ",
        label="CrossQ",
        ranges={**_RANGES, **_ENTROPY, "gradient_steps": whole(1, 8), **_DELAY},
    ),
    "ddpg": _actor_critic(
        DDPGParams,
        learner="stable_baselines3:DDPG",
        ranges=_DETERMINISTIC,
        example=_SHORT | {"action_noise": 0.2},
    ),
    "td3": _actor_critic(
        TD3Params,
        learner="stable_baselines3:TD3",
        ranges={
            **_DETERMINISTIC,
            **_DELAY,
            "target_policy_noise": Between(0.05, 0.5, is_log=False),
        },
        example=_SHORT | {"action_noise": 0.2},
    ),
}
