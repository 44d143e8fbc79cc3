"""What agents choose from: torques, or commands of a table, held for some control steps."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.params.models import ActionParams

NUM_ACTIONS = 8

# The source article's five commands, one a row, in the actuators' order, as signs of the torques:
# none, all forward, all backward, front legs forward and back legs backward, and the reverse.
COMMAND_SIGNS: NDArray[np.float32] = np.array(
    [
        [0.0] * 8,
        [1.0] * 8,
        [-1.0] * 8,
        [1.0] * 4 + [-1.0] * 4,
        [-1.0] * 4 + [1.0] * 4,
    ],
    dtype=np.float32,
)
COMMAND_SIGNS.flags.writeable = False


@dataclass(frozen=True)
class ActionSet:
    """What an agent chooses from at each decision, and how long a choice lasts.

    Attributes:
        table: Torques over peak torques of each command, shape (num_commands, 8); None where any
            torques may be chosen.
        amplitude: Factor on chosen torques, where there is no table.
        hold: Control steps that a choice is held for.
    """

    table: NDArray[np.float32] | None = None
    amplitude: float = 1.0
    hold: int = 1

    @classmethod
    def of(cls, params: ActionParams) -> "ActionSet":
        """Return the set that an agent's parameters describe."""
        if params.kind == "commands":
            return cls(np.float32(params.amplitude) * COMMAND_SIGNS, 1.0, params.hold)
        return cls(None, params.amplitude, params.hold)

    def torques(self, choices: NDArray[Any]) -> NDArray[Any]:
        """Return the torques over peak torques of each choice.

        Args:
            choices: Numbers of commands, shape (n,), or torques in [-1, 1], shape (n, 8).

        Returns:
            Torques in [-amplitude, amplitude], shape (n, 8).
        """
        if self.table is not None:
            return self.table[choices]
        return choices if self.amplitude == 1.0 else self.amplitude * choices

    def sample(self, generator: np.random.Generator) -> NDArray[np.float64]:
        """Draw a choice uniformly, and return its torques, shape (8,)."""
        if self.table is not None:
            return self.table[generator.integers(len(self.table))].astype(np.float64)
        return self.amplitude * generator.uniform(-1.0, 1.0, NUM_ACTIONS)
