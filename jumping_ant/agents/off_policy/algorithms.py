"""Off-policy algorithms of Stable-Baselines3 and SB3-Contrib: their settings and learners.

A learner is Stable-Baselines3's own class, or one of `jumping_ant.agents.off_policy.lean`, which
computes the same with fewer operations. Settings that are parameters of its constructor are passed
to it by name.
"""

import operator
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from jumping_ant.agents.algorithm import Algorithm, defaults
from jumping_ant.agents.sb3.settings import SB3Params
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
NETWORKS = 5  # an actor, two critics and their targets; DQN has fewer
COPIES = 4  # of a learned number: itself, its gradient and Adam's two means


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

    def for_timing(self) -> Self:
        """Return settings whose rows, from the second on, are a few rounds with updates."""
        round_size = self.num_envs * self.train_freq
        rounds = -(-TIMED_UPDATES // self.gradient_steps)
        return self.model_copy(
            update={
                "learning_starts": round_size,
                "log_interval": rounds * round_size,
                "total_steps": 4 * rounds * round_size * self.actions.hold,
            }
        )

    def memory(self, num_observations: int, num_motors: int) -> int:
        """Return about how much memory a seed takes: replay buffer, networks, a batch [bytes]."""
        sizes = [num_observations + num_motors, *self.net_arch, num_motors]
        transition = 4 * (2 * num_observations + num_motors + 3)
        numbers = NETWORKS * COPIES * sum(map(operator.mul, sizes, sizes[1:]))
        return self.buffer_size * transition + 4 * (numbers + 4 * self.batch_size * sum(sizes))

    @model_validator(mode="after")
    def _budget_holds_a_round(self) -> "OffPolicyParams":
        round_steps = self.num_envs * self.train_freq * self.actions.hold
        if self.total_steps < round_steps:
            raise ValueError(
                f"total_steps is {self.total_steps}, but one round of num_envs x train_freq x "
                f"actions.hold takes {round_steps}"
            )
        return self

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


@defaults(batch_size=32, tau=1.0, train_freq=4)
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


@defaults(learning_rate=1e-4)
class DQNParams(ValueParams):
    """Deep Q-network on discrete commands (Mnih et al. 2015)."""

    algorithm: Literal["dqn"]
    """Algorithm of the catalogue."""
    actions: CommandParams
    """Actions that the agent chooses from: commands."""


@defaults(learning_rate=1e-4)
class DecQNParams(ValueParams):
    """Decoupled Q-networks on a few levels for each motor (Seyde et al. 2023)."""

    algorithm: Literal["decqn"]
    """Algorithm of the catalogue."""
    actions: LevelParams
    """Actions that the agent chooses from: levels of each motor."""


@defaults(learning_rate=5e-5, exploration_fraction=0.005, exploration_final_eps=0.01)
class QRDQNParams(ValueParams):
    """Quantile regression deep Q-network on discrete commands (Dabney et al. 2018)."""

    algorithm: Literal["qrdqn"]
    """Algorithm of the catalogue."""
    actions: CommandParams
    """Actions that the agent chooses from: commands."""
    n_quantiles: Annotated[int, Field(ge=1, le=10_000)] = 200
    """[-] Quantiles of each command's return."""

    POLICY_SETTINGS: ClassVar[tuple[str, ...]] = ("net_arch", "n_quantiles")


@defaults(net_arch=[256, 256])
class SACParams(TargetParams):
    """Soft actor-critic on continuous torques (Haarnoja et al. 2018)."""

    algorithm: Literal["sac"]
    """Algorithm of the catalogue."""
    actions: TorqueParams
    """Actions that the agent chooses from: torques."""
    ent_coef: Positive | Literal["auto"] = "auto"
    """[-] Weight of the policy's entropy, or `auto` to learn it."""


class TQCParams(SACParams):
    """Truncated quantile critics on continuous torques (Kuznetsov et al. 2020)."""

    algorithm: Literal["tqc"]  # type: ignore[assignment]
    """Algorithm of the catalogue."""
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


@defaults(learning_rate=1e-3, net_arch=[256, 256])
class CrossQParams(OffPolicyParams):
    """CrossQ on continuous torques: batch renormalisation, no targets (Bhatt et al. 2024)."""

    algorithm: Literal["crossq"]
    """Algorithm of the catalogue."""
    actions: TorqueParams
    """Actions that the agent chooses from: torques."""
    ent_coef: Positive | Literal["auto"] = "auto"
    """[-] Weight of the policy's entropy, or `auto` to learn it."""
    policy_delay: Count = 3
    """[gradient steps] Critic updates per actor update."""


@defaults(learning_rate=1e-3, net_arch=[400, 300])
class DDPGParams(TargetParams):
    """Deep deterministic policy gradients on continuous torques (Lillicrap et al. 2016)."""

    algorithm: Literal["ddpg"]
    """Algorithm of the catalogue."""
    actions: TorqueParams
    """Actions that the agent chooses from: torques."""
    action_noise: NonNegative
    """[-] Standard deviation of the Gaussian exploration noise on the torques."""


@defaults(learning_rate=1e-3, net_arch=[400, 300])
class TD3Params(TargetParams):
    """Twin delayed deterministic policy gradients on continuous torques (Fujimoto et al. 2018)."""

    algorithm: Literal["td3"]
    """Algorithm of the catalogue."""
    actions: TorqueParams
    """Actions that the agent chooses from: torques."""
    action_noise: NonNegative
    """[-] Standard deviation of the Gaussian exploration noise on the torques."""
    policy_delay: Count = 2
    """[gradient steps] Critic updates per actor update."""
    target_policy_noise: NonNegative = 0.2
    """[-] Standard deviation of the noise on the target policy's torques."""
    target_noise_clip: NonNegative = 0.5
    """[-] Limit to which that noise is clipped."""
    n_critics: Annotated[int, Field(ge=1, le=100)] = 2
    """[-] Number of critics; targets are the least of their values."""

    POLICY_SETTINGS: ClassVar[tuple[str, ...]] = ("net_arch", "n_critics")


_LEAN = "jumping_ant.agents.off_policy.lean.learners"
ALGORITHMS = {
    "dqn": Algorithm(
        DQNParams,
        family="value-based",
        learner=f"{_LEAN}:LeanDQN",
        logged=("train/loss", "rollout/exploration_rate"),
        counters=("_n_calls", "exploration_rate"),
    ),
    "decqn": Algorithm(
        DecQNParams,
        family="value-based",
        learner="jumping_ant.agents.off_policy.decqn:DecQN",
        label="DecQN",
        network="dqn",
        logged=("train/loss", "rollout/exploration_rate"),
        counters=("_n_calls", "exploration_rate"),
    ),
    "sac": Algorithm(
        SACParams,
        family="off-policy actor-critic",
        learner=f"{_LEAN}:LeanSAC",
        logged=("train/actor_loss", "train/critic_loss", "train/ent_coef"),
    ),
    "qrdqn": Algorithm(
        QRDQNParams,
        family="value-based",
        learner="sb3_contrib:QRDQN",
        label="QR-DQN",
        logged=("train/loss", "rollout/exploration_rate"),
        counters=("_n_calls", "exploration_rate"),
    ),
    "tqc": Algorithm(
        TQCParams,
        family="off-policy actor-critic",
        learner="sb3_contrib:TQC",
        logged=("train/actor_loss", "train/critic_loss", "train/ent_coef"),
    ),
    "crossq": Algorithm(
        CrossQParams,
        family="off-policy actor-critic",
        learner="sb3_contrib:CrossQ",
        label="CrossQ",
        logged=("train/actor_loss", "train/critic_loss", "train/ent_coef"),
    ),
    "ddpg": Algorithm(
        DDPGParams,
        family="off-policy actor-critic",
        learner="stable_baselines3:DDPG",
        logged=("train/actor_loss", "train/critic_loss"),
    ),
    "td3": Algorithm(
        TD3Params,
        family="off-policy actor-critic",
        learner="stable_baselines3:TD3",
        logged=("train/actor_loss", "train/critic_loss"),
    ),
}
