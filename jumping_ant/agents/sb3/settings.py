"""Settings shared by all algorithms of Stable-Baselines3."""

from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.ranges import Between, OneOf, Ranges
from jumping_ant.params.blocks import ActionParams, Count, Fraction, Positive, Steps

Learning = Annotated[float, Field(gt=0, le=1)]
Layers = Annotated[list[Annotated[int, Field(ge=1, le=65_536)]], Field(min_length=1)]

EPISODE_RANGES: Ranges = {
    "long_episodes": OneOf((0.0, 0.25, 0.5, 0.75, 1.0)),
    "tumbled_starts": Between(0.0, 0.75, is_log=False),
}


class SB3Params(AgentBlock):
    """Settings shared by the algorithms of Stable-Baselines3, named as there.

    The library's settings have its defaults; by default this project adds nothing to them.

    A transition is a decision; if actions are held for several control steps, it spans as many.
    """

    actions: ActionParams
    """Actions that the agent chooses from."""
    total_steps: Steps
    """[control steps] Training budget of a seed."""
    episode_steps: Count | None = None
    """[control steps] Training episodes are truncated here; null never truncates them."""
    long_episodes: Fraction = 0.0
    """[-] Share of the environments whose episodes last for `env.max_episode_steps` instead."""
    tumbled_starts: Fraction = 0.0
    """[-] Share of the training episodes that start in the air, in any orientation."""
    sparse_rewards: bool = False
    """Whether the agent learns from an episode's return at its end, and no reward before."""
    num_envs: Annotated[int, Field(ge=1, le=10_000)] = 1
    """[-] Simulations stepped in parallel."""
    learning_rate: Learning = 3e-4
    """[-] Initial learning rate."""
    final_learning_rate: Fraction | None = None
    """[-] Final learning rate, linear in between; null keeps the initial one."""
    gamma: Fraction = 0.99
    """[-] Discount factor per decision."""
    net_arch: Layers = [64, 64]
    """[units] Sizes of the hidden layers."""
    velocity_scale: Positive = 1.0
    """[-] Factor on the velocities that the agent observes."""
    log_interval: Steps = 1000
    """[transitions] Interval between rows of the learning curve."""

    POLICY_SETTINGS: ClassVar[tuple[str, ...]] = ("net_arch",)
    """Settings that Stable-Baselines3 takes as `policy_kwargs`."""
    ROUND: ClassVar[str]
    """The setting that says how many decisions of each environment are between updates."""

    @property
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps], if no robot falls within a decision."""
        return self.total_steps

    @property
    def round_size(self) -> int:
        """Decisions of a round, in all environments."""
        return self.num_envs * int(getattr(self, self.ROUND))

    @model_validator(mode="after")
    def _budget_holds_a_round(self) -> Self:
        round_steps = self.round_size * self.actions.hold
        if self.total_steps < round_steps:
            raise ValueError(
                f"total_steps is {self.total_steps}, but one round of num_envs x {self.ROUND} x "
                f"actions.hold takes {round_steps}"
            )
        return self
