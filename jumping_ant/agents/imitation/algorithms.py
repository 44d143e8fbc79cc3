"""Imitation of another agent: settings."""

from typing import Annotated, ClassVar

from pydantic import Field

from jumping_ant.agents.algorithm import TORQUES, AgentBlock, Algorithm, settings
from jumping_ant.agents.ranges import Between, OneOf, Ranges, whole
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


@settings("bc")
class BCParams(ImitationParams):
    """Behaviour cloning: all data are demonstrations (Pomerleau 1991)."""


@settings("dagger")
class DAggerParams(ImitationParams):
    """Dataset aggregation (Ross, Gordon and Bagnell 2011).

    The first round's data are demonstrations. In later rounds the agent acts itself, and the
    demonstrated policy says what it would have done.
    """

    episode_steps: Count
    """[control steps] The agent's own episodes are truncated here."""
    tumbled_starts: Fraction
    """[-] Share of the agent's own episodes that start in the air, in any orientation."""


_FITS: Ranges = {
    "learning_rate": Between(2e-4, 5e-3),
    "batch_size": OneOf((64, 128, 256)),
    "net_arch": OneOf(([64, 64], [128, 128], [256, 256])),
    "rounds": whole(4, 32),
    "updates_per_round": whole(100, 2000),
    "velocity_scale": Between(0.03, 0.3),
}
_SHORT = {
    "actions": TORQUES,
    "total_steps": 240,
    "rounds": 4,
    "updates_per_round": 20,
    "learning_rate": 0.002,
    "batch_size": 64,
    "net_arch": [128, 128],
    "velocity_scale": 0.1,
}
ALGORITHMS = {
    "bc": Algorithm(BCParams, family="imitation", ranges=_FITS, example=_SHORT),
    "dagger": Algorithm(
        DAggerParams,
        family="imitation",
        label="DAgger",
        ranges=_FITS,
        example=_SHORT | {"episode_steps": 30, "tumbled_starts": 0.25},
    ),
}
