"""Off-policy algorithms of Stable-Baselines3: their settings and learners.

A learner is Stable-Baselines3's own class, or one of `jumping_ant.agents.off_policy.lean`, which
computes the same with fewer operations. Settings that are parameters of its constructor are passed
to it by name.
"""

import operator
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from jumping_ant.agents.algorithm import AgentBlock, Algorithm
from jumping_ant.params.blocks import (
    ActionParams,
    CommandParams,
    Count,
    Fraction,
    NonNegative,
    Positive,
    Steps,
    TorqueParams,
)

TIMED_UPDATES = 64  # gradient steps per timed unit of work
NETWORKS = 5  # an actor, two critics and their targets; DQN has fewer
COPIES = 4  # of a learned number: itself, its gradient and Adam's two means


class OffPolicyParams(AgentBlock):
    """Settings shared by the off-policy algorithms, named as in Stable-Baselines3.

    A transition is a decision; if actions are held for several control steps, it spans as many.
    """

    trainer: Literal["off_policy"]
    """Package of jumping_ant/agents/ that trains the agent."""
    actions: ActionParams
    """Actions that the agent chooses from."""
    total_steps: Steps
    """[control steps] Training budget of a seed."""
    episode_steps: Count | None
    """[control steps] Training episodes are truncated here; null never truncates them."""
    long_episodes: Fraction
    """[-] Share of the environments whose episodes last for `env.max_episode_steps` instead."""
    tumbled_starts: Fraction
    """[-] Share of the training episodes that start in the air, in any orientation."""
    num_envs: Annotated[int, Field(ge=1, le=10_000)]
    """[-] Simulations stepped in parallel."""
    learning_rate: Annotated[float, Field(gt=0, le=1)]
    """[-] Initial learning rate of Adam."""
    final_learning_rate: Fraction
    """[-] Final learning rate of Adam; linear in between."""
    buffer_size: Annotated[int, Field(ge=1, le=10**9)]
    """[transitions] Capacity of the replay buffer."""
    learning_starts: Annotated[int, Field(ge=0, le=10**9)]
    """[transitions] Random actions before the first update."""
    batch_size: Count
    """[transitions] Batch size of a gradient step."""
    tau: Fraction
    """[-] Weight of the online networks in an update of the target networks."""
    gamma: Fraction
    """[-] Discount factor per decision."""
    n_steps: Count
    """[decisions] Number of rewards before the bootstrap."""
    train_freq: Count
    """[decisions of each environment] Interval between rounds of updates."""
    gradient_steps: Count
    """[-] Gradient steps per round of updates."""
    net_arch: Annotated[list[Annotated[int, Field(ge=1, le=65_536)]], Field(min_length=1)]
    """[units] Sizes of the hidden layers."""
    velocity_scale: Positive
    """[-] Factor on the velocities that the agent observes."""
    log_interval: Steps
    """[transitions] Interval between rows of the learning curve."""

    @property
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps]."""
        return self.total_steps

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


class DQNParams(OffPolicyParams):
    """Deep Q-network on discrete commands (Mnih et al. 2015)."""

    algorithm: Literal["dqn"]
    """Algorithm that the trainer runs."""
    actions: CommandParams
    """Actions that the agent chooses from: commands."""
    target_update_interval: Steps
    """[transitions] Interval between target updates."""
    exploration_fraction: Annotated[float, Field(gt=0, le=1)]
    """[-] Share of the budget over which exploration decays."""
    exploration_initial_eps: Fraction
    """[-] Initial probability of a random command."""
    exploration_final_eps: Fraction
    """[-] Probability of a random command after the decay."""
    max_grad_norm: Positive
    """[-] Gradients are clipped to this norm."""


class SACParams(OffPolicyParams):
    """Soft actor-critic on continuous torques (Haarnoja et al. 2018)."""

    algorithm: Literal["sac"]
    """Algorithm that the trainer runs."""
    actions: TorqueParams
    """Actions that the agent chooses from: torques."""
    ent_coef: Positive | Literal["auto"]
    """[-] Weight of the policy's entropy, or `auto` to learn it."""


class TD3Params(OffPolicyParams):
    """Twin delayed deterministic policy gradients on continuous torques (Fujimoto et al. 2018)."""

    algorithm: Literal["td3"]
    """Algorithm that the trainer runs."""
    actions: TorqueParams
    """Actions that the agent chooses from: torques."""
    action_noise: NonNegative
    """[-] Standard deviation of the Gaussian exploration noise on the torques."""
    policy_delay: Count
    """[gradient steps] Critic updates per actor update."""
    target_policy_noise: NonNegative
    """[-] Standard deviation of the noise on the target policy's torques."""
    target_noise_clip: NonNegative
    """[-] Limit to which that noise is clipped."""


_LEAN = "jumping_ant.agents.off_policy.lean.learners"
ALGORITHMS = {
    "dqn": Algorithm(
        DQNParams,
        learner=f"{_LEAN}:LeanDQN",
        logged=("train/loss", "rollout/exploration_rate"),
        counters=("_n_calls", "exploration_rate"),
    ),
    "sac": Algorithm(
        SACParams,
        learner=f"{_LEAN}:LeanSAC",
        logged=("train/actor_loss", "train/critic_loss", "train/ent_coef"),
    ),
    "td3": Algorithm(
        TD3Params,
        learner="stable_baselines3:TD3",
        logged=("train/actor_loss", "train/critic_loss"),
    ),
}
