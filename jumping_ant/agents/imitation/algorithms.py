"""Imitation of another agent: settings."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from jumping_ant.agents.algorithm import AgentBlock, Algorithm
from jumping_ant.agents.sb3.settings import Layers, Learning
from jumping_ant.params.blocks import Count, Fraction, Positive, Steps, TorqueParams


class ImitationParams(AgentBlock):
    """Settings shared by agents that learn from demonstrations.

    The network, an actor of Stable-Baselines3, is fitted to the torques of the demonstrated agent
    on data that grow in rounds of equal size.
    """

    learns_from_demonstrations: ClassVar[bool] = True

    actions: TorqueParams
    """Actions that the agent chooses from; those of the demonstrated agent."""
    total_steps: Steps
    """[control steps] Budget of a seed: control steps of all data, demonstrated or its own."""
    rounds: Count
    """[-] Rounds in which the data grow."""
    updates_per_round: Count
    """[-] Gradient steps in a round."""
    learning_rate: Learning
    """[-] Learning rate of Adam."""
    batch_size: Annotated[int, Field(ge=1, le=10**7)]
    """[decisions] Size of the minibatches."""
    net_arch: Layers
    """[units] Sizes of the hidden layers."""
    velocity_scale: Positive
    """[-] Factor on the velocities that the agent observes."""

    @property
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps]."""
        return self.total_steps

    def memory(self, num_observations: int, num_motors: int) -> int:
        """Return about how much memory a seed takes: that of its data, twice [bytes]."""
        decisions = self.total_steps // self.actions.hold
        return 2 * 4 * decisions * (num_observations + num_motors + 1)


class BCParams(ImitationParams):
    """Behaviour cloning: all data are demonstrations (Pomerleau 1991)."""

    algorithm: Literal["bc"]
    """Algorithm of the catalogue."""


class DAggerParams(ImitationParams):
    """Dataset aggregation (Ross, Gordon and Bagnell 2011).

    The first round's data are demonstrations. In later rounds the agent acts itself, and the
    demonstrated policy says what it would have done.
    """

    algorithm: Literal["dagger"]
    """Algorithm of the catalogue."""
    episode_steps: Count
    """[control steps] The agent's own episodes are truncated here."""
    tumbled_starts: Fraction
    """[-] Share of the agent's own episodes that start in the air, in any orientation."""


ALGORITHMS = {
    "bc": Algorithm(BCParams, family="imitation"),
    "dagger": Algorithm(DAggerParams, family="imitation", label="DAgger"),
}
