"""Settings shared by all algorithms of Stable-Baselines3."""

from typing import Annotated, ClassVar

from pydantic import Field

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.params.blocks import ActionParams, Count, Fraction, Positive, Steps

Learning = Annotated[float, Field(gt=0, le=1)]
Layers = Annotated[list[Annotated[int, Field(ge=1, le=65_536)]], Field(min_length=1)]


class SB3Params(AgentBlock):
    """Settings shared by the algorithms of Stable-Baselines3, named as there.

    A transition is a decision; if actions are held for several control steps, it spans as many.
    """

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
    sparse_rewards: bool
    """Whether the agent learns from an episode's return at its end, and no reward before."""
    num_envs: Annotated[int, Field(ge=1, le=10_000)]
    """[-] Simulations stepped in parallel."""
    learning_rate: Learning
    """[-] Initial learning rate."""
    final_learning_rate: Fraction
    """[-] Final learning rate; linear in between."""
    gamma: Fraction
    """[-] Discount factor per decision."""
    net_arch: Layers
    """[units] Sizes of the hidden layers."""
    velocity_scale: Positive
    """[-] Factor on the velocities that the agent observes."""
    log_interval: Steps
    """[transitions] Interval between rows of the learning curve."""

    POLICY_SETTINGS: ClassVar[tuple[str, ...]] = ("net_arch",)
    """Settings that Stable-Baselines3 takes as `policy_kwargs`."""

    @property
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps]."""
        return self.total_steps
