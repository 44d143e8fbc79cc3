"""Action sets: torques, commands of a table, or levels per motor, held for some control steps."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.params.blocks import ActionParams


@dataclass(frozen=True)
class ActionSet:
    """What an agent chooses from at each decision, and how long each choice is held.

    Attributes:
        table: Torques over peak torques of each command, shape (num_commands, num_motors);
            None if there are no commands.
        amplitude: Factor on chosen torques and levels, if there is no table.
        hold: Control steps that a choice is held for.
        levels: Number of torques that each motor chooses from, evenly spaced from -amplitude to
            amplitude; None if there are no levels. Without table and levels, any torques may be
            chosen.
    """

    table: NDArray[np.float32] | None = None
    amplitude: float = 1.0
    hold: int = 1
    levels: int | None = None

    @classmethod
    def of(cls, params: ActionParams, commands: Sequence[Sequence[float]]) -> "ActionSet":
        """Return the set that an agent's parameters describe.

        Args:
            params: The agent's block of actions.
            commands: The table of commands, `env.commands`.
        """
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
        """Return what a policy's outputs choose.

        Args:
            outputs: Shape (n, num_outputs).

        Returns:
            The torques, clipped to [-1, 1]; the index of the command of the largest output; or the
            index of the level that is nearest to each motor's output, the upper one of two that are
            equally near: with two levels an output's sign decides, and 0 counts as positive.
        """
        if self.table is not None:
            return np.argmax(outputs, axis=1)
        if self.levels is not None:
            between = np.linspace(-1.0, 1.0, 2 * self.levels - 1)[1::2]  # adjacent levels
            return np.searchsorted(between, outputs, side="right")
        return np.clip(outputs, -1.0, 1.0).astype(np.float64)

    def best(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the choices of the highest values, among commands or among each motor's levels.

        Args:
            values: Of each command, shape (n, num_commands), or of each level of each motor, the
                first motor's first, (n, num_motors * levels).

        Returns:
            Indices of commands, shape (n,), or of levels, (n, num_motors).
        """
        if self.levels is not None:
            values = values.reshape(len(values), -1, self.levels)
        return np.argmax(values, axis=-1)

    def torques(self, choices: NDArray[Any]) -> NDArray[Any]:
        """Return the torques over peak torques of each choice.

        Args:
            choices: Indices of commands, shape (n,), torques in [-1, 1], shape (n, num_motors), or
                indices of levels, shape (n, num_motors).

        Returns:
            Torques in [-amplitude, amplitude], shape (n, num_motors).
        """
        if self.table is not None:
            return self.table[choices]
        if self.levels is not None:
            return self.amplitude * (2.0 / (self.levels - 1) * choices - 1.0)
        return choices if self.amplitude == 1.0 else self.amplitude * choices

    def sample(self, generator: np.random.Generator, num_motors: int) -> NDArray[np.float64]:
        """Draw a choice uniformly, and return its torques, shape (num_motors,)."""
        if self.table is not None:
            return self.table[generator.integers(len(self.table))].astype(np.float64)
        if self.levels is not None:
            return self.torques(generator.integers(self.levels, size=num_motors))
        return self.amplitude * generator.uniform(-1.0, 1.0, num_motors)
