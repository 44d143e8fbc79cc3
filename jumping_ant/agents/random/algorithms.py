"""The settings of the random agent."""

from typing import Literal

from jumping_ant.agents.algorithm import AgentBlock, Algorithm
from jumping_ant.params.blocks import ActionParams


class RandomAgentParams(AgentBlock):
    """The baseline that draws a random action at every decision and learns nothing."""

    is_baseline = True

    trainer: Literal["random"]
    """Package of jumping_ant/agents/ that trains the agent."""
    algorithm: Literal["random"]
    """Algorithm that the trainer runs."""
    actions: ActionParams
    """Actions that it draws from."""

    @property
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps]: none."""
        return 0


ALGORITHMS = {"random": Algorithm(RandomAgentParams, family="baseline")}
