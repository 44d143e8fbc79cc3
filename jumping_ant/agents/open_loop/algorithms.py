"""The settings of open-loop rhythms."""

from typing import Annotated, Literal

from pydantic import Field

from jumping_ant.agents.algorithm import AgentBlock, Algorithm
from jumping_ant.params.blocks import Count, EnvParams


class OpenLoopParams(AgentBlock):
    """The sceptic's baseline: a cycle of commands that ignores the state."""

    is_baseline = True
    depends_on_seed = False  # all seeds share the search and its rhythm

    algorithm: Literal["open_loop"]
    """Algorithm of the catalogue."""
    amplitude: Annotated[float, Field(gt=0, le=1)]
    """[-] Factor on the torques of the commands; the article's have 0.5."""
    commands: Annotated[list[Annotated[int, Field(ge=0, le=10**6)]], Field(min_length=1)]
    """[-] Rows of `env.commands` that it cycles through, counted from 0."""
    half_periods: Annotated[list[Count], Field(min_length=1)]
    """[control steps] Rhythms to try: how long each command is held."""
    episodes: Count
    """[-] Episodes per rhythm."""
    episode_steps: Count
    """[control steps] Length of each episode."""

    def fault(self, env: EnvParams) -> str | None:
        """Return which command is not in the task's table, or None if all are."""
        last = len(env.commands) - 1
        for number in self.commands:
            if number > last:
                return f"commands: given {number}, allowed: 0 to {last}, the rows of env.commands"
        return None

    @property
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps], if no episode ends early."""
        return len(self.half_periods) * self.episodes * self.episode_steps

    def has_ended(self, env_steps: int, updates: int) -> bool:
        """Return whether a seed has tried all rhythms."""
        return updates >= len(self.half_periods)


ALGORITHMS = {"open_loop": Algorithm(OpenLoopParams, family="baseline")}
