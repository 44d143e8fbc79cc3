"""Action sets: torques, or commands of a table, held for some control steps."""

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
            None if any torques may be chosen.
        amplitude: Factor on chosen torques, if there is no table.
        hold: Control steps that a choice is held for.
    """

    table: NDArray[np.float32] | None = None
    amplitude: float = 1.0
    hold: int = 1

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
        return cls(None, params.amplitude, params.hold)

    def num_outputs(self, num_motors: int) -> int:
        """Return how many outputs a policy has that chooses from this set."""
        return num_motors if self.table is None else len(self.table)

    def choices(self, outputs: NDArray[Any]) -> NDArray[Any]:
        """Return what a policy's outputs choose.

        Args:
            outputs: Shape (n, num_outputs).

        Returns:
            The torques, clipped to [-1, 1], or the index of the command of the largest output.
        """
        if self.table is not None:
            return np.argmax(outputs, axis=1)
        return np.clip(outputs, -1.0, 1.0).astype(np.float64)

    def torques(self, choices: NDArray[Any]) -> NDArray[Any]:
        """Return the torques over peak torques of each choice.

        Args:
            choices: Indices of commands, shape (n,), or torques in [-1, 1], shape (n, num_motors).

        Returns:
            Torques in [-amplitude, amplitude], shape (n, num_motors).
        """
        if self.table is not None:
            return self.table[choices]
        return choices if self.amplitude == 1.0 else self.amplitude * choices

    def sample(self, generator: np.random.Generator, num_motors: int) -> NDArray[np.float64]:
        """Draw a choice uniformly, and return its torques, shape (num_motors,)."""
        if self.table is not None:
            return self.table[generator.integers(len(self.table))].astype(np.float64)
        return self.amplitude * generator.uniform(-1.0, 1.0, num_motors)
