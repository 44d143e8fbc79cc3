"""Search spaces: an agent's settings as Optuna's parameters, and back."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)
from pydantic import ValidationError

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.evolution import ranges as evolution
from jumping_ant.agents.imitation import ranges as imitation
from jumping_ant.agents.off_policy import ranges as off_policy
from jumping_ant.agents.on_policy import ranges as on_policy
from jumping_ant.agents.ranges import Between, OneOf, Ranges
from jumping_ant.base.errors import InputError

DIGITS = 3  # significant ones, of numbers that are drawn: people read and type them
RANGES: dict[str, Ranges] = {
    **off_policy.RANGES,
    **on_policy.RANGES,
    **evolution.RANGES,
    **imitation.RANGES,
}
"""By algorithm."""


class RefusedError(ValueError):
    """Settings that no training can have; the message says why."""


@dataclass(frozen=True)
class Space:
    """The settings of an agent that a search may change.

    Attributes:
        agent: The agent as it is.
        ranges: What may be chosen, by setting.
    """

    agent: AgentBlock
    ranges: Ranges

    @property
    def distributions(self) -> dict[str, BaseDistribution]:
        """The parameters in Optuna's terms."""
        return {name: _distribution(own) for name, own in self.ranges.items()}

    @property
    def outside(self) -> list[str]:
        """Names of the settings of the agent as it is that lie outside of their ranges."""
        return [name for name, own in self.ranges.items() if not own.has(getattr(self.agent, name))]

    @property
    def own(self) -> dict[str, Any]:
        """The agent as it is, as Optuna's parameters."""
        return {
            name: encode(getattr(self.agent, name)) if isinstance(own, OneOf) else value
            for name, own in self.ranges.items()
            if (value := getattr(self.agent, name)) is not None
        }

    @property
    def described(self) -> dict[str, Any]:
        """The ranges as JSON has them."""
        described: dict[str, Any] = json.loads(
            json.dumps({name: asdict(own) for name, own in self.ranges.items()})
        )
        return described

    def agent_with(self, chosen: Mapping[str, Any], share: float = 1.0) -> AgentBlock:
        """Return the agent with other settings and a share of its own budget of control steps.

        Args:
            chosen: Optuna's parameters.
            share: Of the budget of the agent as it is.

        Raises:
            RefusedError: The settings do not fit each other.
        """
        settings = self.agent.model_dump() | self.chosen(chosen)
        steps = share * self.agent.max_env_steps
        if "generations" in settings:
            each = settings["population_size"] * settings["episode_steps"]
            settings["generations"] = max(1, round(steps / each))
        else:
            settings["total_steps"] = round(steps)
        try:
            return type(self.agent).model_validate(settings)
        except ValidationError as error:
            reasons = [str(fault["msg"]).removeprefix("Value error, ") for fault in error.errors()]
            raise RefusedError("; ".join(reasons)) from error

    def chosen(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Return the settings that Optuna's parameters stand for, but the agent's own."""
        others = {name: own for name, own in parameters.items() if own != self.own.get(name)}
        return {name: decode(own) for name, own in others.items()}

    def changes(self, agent: AgentBlock) -> dict[str, Any]:
        """Return the settings of an agent that are not those of the agent as it is."""
        own = self.agent.model_dump()
        return {name: value for name, value in agent.model_dump().items() if value != own[name]}


def space_of(name: str, agent: AgentBlock) -> Space:
    """Return the search space of an agent.

    Raises:
        InputError: Its algorithm has none.
    """
    if agent.algorithm not in RANGES:
        raise InputError(f"agent: given {name!r}, allowed: those of {', '.join(RANGES)}")
    return Space(agent, RANGES[agent.algorithm])


def encode(value: Any) -> bool | int | float | str:
    """Return a value as Optuna stores one of several: lists as JSON."""
    return json.dumps(value) if isinstance(value, list) else value


def decode(value: Any) -> Any:
    """Return the setting that a parameter of Optuna stands for; numbers are rounded."""
    if isinstance(value, str) and value.startswith("["):
        return json.loads(value)
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def _distribution(own: Between | OneOf) -> BaseDistribution:
    if isinstance(own, OneOf):
        return CategoricalDistribution([encode(value) for value in own.values])
    if own.is_whole:
        return IntDistribution(int(own.low), int(own.high), log=own.is_log)
    return FloatDistribution(own.low, own.high, log=own.is_log)
