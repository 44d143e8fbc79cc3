"""Agents that learn nothing: random actions, and open-loop rhythms."""

from typing import Annotated

from pydantic import Field

from jumping_ant.agents.algorithm import TORQUES, AgentBlock, Algorithm, settings
from jumping_ant.params.blocks import ActionParams, Count, EnvParams


@settings("random")
class RandomAgentParams(AgentBlock):
    """The baseline that draws a random action at every decision and learns nothing."""

    is_baseline = True

    actions: ActionParams
    """Actions that it draws from."""

    @property
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps]: none."""
        return 0


@settings("open_loop")
class OpenLoopParams(AgentBlock):
    """The sceptic's baseline: a cycle of commands that ignores the state."""

    is_baseline = True
    depends_on_seed = False  # all seeds share the search and its rhythm

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


_TRAINER = "jumping_ant.agents.baselines.trainer"
ALGORITHMS = {
    "random": Algorithm(
        RandomAgentParams,
        family="baseline",
        learner=f"{_TRAINER}:draw",
        policy_kind="uniform",
        about="a baseline that acts at random",
        is_perturbed=False,  # random actions hold no posture or rhythm that could be disturbed
        example={"actions": TORQUES},
    ),
    "open_loop": Algorithm(
        OpenLoopParams,
        family="baseline",
        learner=f"{_TRAINER}:search",
        about="a baseline that moves to a fixed beat and ignores observations",
        example={
            "amplitude": 0.5,
            "commands": [3, 4],
            "half_periods": [2, 3],
            "episodes": 2,
            "episode_steps": 30,
        },
    ),
}
