"""Search spaces: an agent's settings as Optuna's parameters, and back."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import optuna
from pydantic import ValidationError

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.agents.ranges import OneOf, Ranges
from jumping_ant.base.errors import InputError

DIGITS = 3  # significant ones, of numbers that are drawn: people read and type them
RANGES = {name: row.ranges for name, row in ALGORITHMS.items() if row.ranges}


class RefusedError(ValueError):
    """Settings that do not fit each other; the message says why."""


@dataclass(frozen=True)
class Space:
    """The agent as it is, and by setting what a search may choose instead."""

    agent: AgentBlock
    ranges: Ranges

    def suggest(self, trial: optuna.Trial) -> None:
        """Have all parameters of a trial drawn."""
        for name, range_ in self.ranges.items():
            if isinstance(range_, OneOf):
                trial.suggest_categorical(name, [encode(value) for value in range_.values])
            elif range_.is_whole:
                trial.suggest_int(name, int(range_.low), int(range_.high), log=range_.is_log)
            else:
                trial.suggest_float(name, range_.low, range_.high, log=range_.is_log)

    @property
    def present(self) -> dict[str, Any]:
        """The agent as it is, as Optuna's parameters."""
        values = {name: encode(getattr(self.agent, name)) for name in self.ranges}
        return {name: value for name, value in values.items() if value is not None}

    def agent_with(self, chosen: Mapping[str, Any], share: float = 1.0) -> AgentBlock:
        """Return the agent with Optuna's parameters and a share of its budget of control steps."""
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
        """Return the settings that Optuna's parameters stand for, without the present ones."""
        present = self.present
        return {key: decode(it) for key, it in parameters.items() if it != present.get(key)}

    def changes(self, agent: AgentBlock) -> dict[str, Any]:
        """Return the settings of an agent that are not those of the agent as it is."""
        present = self.agent.model_dump()
        return {key: it for key, it in agent.model_dump().items() if it != present[key]}


def space_of(name: str, agent: AgentBlock) -> Space:
    """Return the search space of an agent; an InputError says that its algorithm has none."""
    if agent.algorithm not in RANGES:
        raise InputError(f"agent: given {name!r}, allowed: those of {', '.join(RANGES)}")
    return Space(agent, RANGES[agent.algorithm])


def encode(value: Any) -> Any:
    """Return a value as Optuna stores it: lists as JSON."""
    return json.dumps(value) if isinstance(value, list) else value


def decode(value: Any) -> Any:
    """Return the setting that a parameter of Optuna stands for; numbers are rounded."""
    if isinstance(value, str) and value.startswith("["):
        return json.loads(value)
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value
