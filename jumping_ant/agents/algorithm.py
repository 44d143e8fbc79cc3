"""What an algorithm is: a row of the catalogue, and the settings that all of them share."""

from dataclasses import dataclass
from typing import ClassVar, Literal, Self

from jumping_ant.params.blocks import Block, EnvParams


class AgentBlock(Block):
    """What the blocks of all agents have in common; an algorithm's own settings come on top."""

    is_baseline: ClassVar[bool] = False  # whether it learns nothing

    trainer: str
    """Package of jumping_ant/agents/ that trains the agent."""
    algorithm: str
    """What it trains there."""
    robot: Literal["edited", "unedited"]
    """Which robot it moves: the one of `robot`, or its source as it comes."""

    @property
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps]; 0 where nothing is trained."""
        raise NotImplementedError

    def fault(self, env: EnvParams) -> str | None:
        """Return what of the block does not fit the task, if anything: key, given and allowed."""
        return None

    def for_timing(self) -> Self | None:
        """Return settings under which each row of the learning curve is one unit of work.

        A unit is what more threads share out: a generation, or some rounds of experience and
        updates. None where there is nothing to time.
        """
        return None


@dataclass(frozen=True)
class Algorithm:
    """A row of the catalogue.

    Attributes:
        settings: The model of its block in `params.yaml`.
        learner: What its trainer builds, as `module:name`, which is imported when it trains; empty
            where the trainer needs no choice.
        logged: What the learning curve keeps of what the learner logs, by the learner's own names.
        counters: Numbers that the learner keeps beside those that all of its family do.
    """

    settings: type[AgentBlock]
    learner: str = ""
    logged: tuple[str, ...] = ()
    counters: tuple[str, ...] = ()

    @property
    def is_baseline(self) -> bool:
        """Whether it learns nothing."""
        return self.settings.is_baseline
