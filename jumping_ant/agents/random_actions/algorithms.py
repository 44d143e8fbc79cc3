"""The settings of the random agent."""

from typing import Literal

from jumping_ant.agents.algorithm import AgentBlock, Algorithm
from jumping_ant.params.blocks import ActionParams


class RandomAgentParams(AgentBlock):
    """The baseline that draws a random action at every decision and learns nothing."""

    is_baseline = True

    algorithm: Literal["random"]
    """Algorithm of the catalogue."""
    actions: ActionParams
    """Actions that it draws from."""

    @property
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps]: none."""
        return 0


ALGORITHMS = {"random": Algorithm(RandomAgentParams, family="baseline", network="uniform")}
