"""Action sets: torques, commands of a table, or levels per motor, held for some control steps."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.base.errors import InputError
from jumping_ant.params.blocks import ActionParams


@dataclass(frozen=True)
class ActionSet:
    """What an agent chooses from at each decision, and how long each choice is held.

    Without table and levels, any torques may be chosen.
    """

    table: NDArray[np.float32] | None = None  # commands' torques over peak torques, (n, num_motors)
    amplitude: float = 1.0  # factor on chosen torques and levels
    hold: int = 1  # [control steps]
    levels: int | None = None  # of each motor, evenly spaced from -amplitude to amplitude

    @classmethod
    def of(cls, params: ActionParams, commands: Sequence[Sequence[float]]) -> "ActionSet":
        """Return the set of an agent's block of actions; `commands` is `env.commands`."""
        if params.kind == "commands":
            table = np.float32(params.amplitude) * np.array(commands, dtype=np.float32)
            return cls(table, 1.0, params.hold)
        return cls(None, params.amplitude, params.hold, params.levels)

    @property
    def chooses_torques(self) -> bool:
        """Whether any torques may be chosen."""
        return self.table is None and self.levels is None

    def num_outputs(self, num_motors: int) -> int:
        """Return how many outputs a policy has that chooses from this set by `choices`."""
        return num_motors if self.table is None else len(self.table)

    def num_motors(self, num_outputs: int) -> int:
        """Return how many motors a policy with so many outputs drives."""
        return num_outputs if self.table is None else self.table.shape[1]

    def choices(self, outputs: NDArray[Any]) -> NDArray[Any]:
        """Return what a policy's outputs, shape (n, num_outputs), choose.

        That is the torques, clipped to [-1, 1]; the index of the command of the largest output; or
        the index of the level that is nearest to each motor's output, the upper one of two that are
        equally near: with two levels an output's sign decides, and 0 counts as positive.
        """
        if self.table is not None:
            return np.argmax(outputs, axis=1)
        if self.levels is not None:
            between = np.linspace(-1.0, 1.0, 2 * self.levels - 1)[1::2]  # adjacent levels
            return np.searchsorted(between, outputs, side="right")
        return np.clip(outputs, -1.0, 1.0).astype(np.float64)

    def best(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the indices of commands, (n,), or of levels, (n, num_motors), of highest value.

        Values are of each command, (n, num_commands), or of each level of each motor, the first
        motor's first, (n, num_motors * levels).
        """
        if self.levels is not None:
            values = values.reshape(len(values), -1, self.levels)
        return np.argmax(values, axis=-1)

    def torques(self, choices: NDArray[Any]) -> NDArray[Any]:
        """Return torques over peak torques in [-amplitude, amplitude], shape (n, num_motors).

        Choices are indices of commands, (n,), or torques in [-1, 1] or indices of levels,
        (n, num_motors); an InputError names an index that stands for nothing.
        """
        if self.table is not None:
            return self.table[_indices(choices, len(self.table))]
        if self.levels is not None:
            choices = _indices(choices, self.levels)
            return self.amplitude * (2.0 / (self.levels - 1) * choices - 1.0)
        return choices if self.amplitude == 1.0 else self.amplitude * choices

    def sample(self, generator: np.random.Generator, num_motors: int) -> NDArray[np.float64]:
        """Draw a choice uniformly, and return its torques, shape (num_motors,)."""
        if self.table is not None:
            return self.table[generator.integers(len(self.table))].astype(np.float64)
        if self.levels is not None:
            return self.torques(generator.integers(self.levels, size=num_motors))
        return self.amplitude * generator.uniform(-1.0, 1.0, num_motors)


def _indices(choices: NDArray[Any], count: int) -> NDArray[Any]:
    choices = np.asarray(choices)
    if choices.dtype.kind not in "iu" or not ((choices >= 0) & (choices < count)).all():
        raise InputError(f"actions: given {choices.tolist()}, allowed: 0 to {count - 1}")
    return choices
