"""Linear policies, and the distribution over them that evolution maintains."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.policy import Array, Entries, Interface, Stateless, arrays_of, to_file


@dataclass(frozen=True)
class LinearPolicy(Stateless):
    """A linear map of normalised observations: torques, or a preference for each command."""

    weight: NDArray[np.float32]  # (num_outputs, num_observations)
    bias: NDArray[np.float32]  # (num_outputs,)
    mean: NDArray[np.float32]  # subtracted from observations, (num_observations,)
    stdev: NDArray[np.float32]  # observations are then divided by it, (num_observations,)
    weight_spread: NDArray[np.float32]  # standard deviation of each weight in `sample`
    bias_spread: NDArray[np.float32]  # that of each bias, (num_outputs,)
    actions: ActionSet

    ARRAYS: ClassVar = ("weight", "bias", "mean", "stdev", "weight_spread", "bias_spread")

    def act(self, observations: Array) -> Array:
        """Return torques, shape (n, num_motors)."""
        normalized = (observations.astype(np.float32) - self.mean) / self.stdev
        outputs = (normalized[:, None] @ self.weight.T)[:, 0]  # row by row (see `Policy.act`)
        choices = self.actions.choices(outputs + self.bias)
        return self.actions.torques(choices).astype(np.float64, copy=False)

    def sample(self, generator: np.random.Generator) -> "LinearPolicy":
        """Draw another policy from the distribution that this one is the centre of."""

        def around(center: NDArray[np.float32], spread: NDArray[np.float32]) -> Any:
            return center + spread * generator.standard_normal(center.shape, np.float32)

        return replace(
            self,
            weight=around(self.weight, self.weight_spread),
            bias=around(self.bias, self.bias_spread),
        )

    def to_bytes(self) -> bytes:
        """Return the policy file's content."""
        outputs, num_observations = self.weight.shape
        num_motors = self.actions.num_motors(outputs)
        interface = Interface(self.actions, num_observations, num_motors)
        return to_file("linear", interface, {name: getattr(self, name) for name in self.ARRAYS})

    @classmethod
    def from_entries(cls, interface: Interface, entries: Entries) -> "LinearPolicy":
        """Build the policy from a policy file's entries."""
        outputs = interface.actions.num_outputs(interface.num_motors)
        matrix, seen = (outputs, interface.num_observations), (interface.num_observations,)
        shapes = (matrix, (outputs,), seen, seen, matrix, (outputs,))
        arrays = arrays_of(entries, **dict(zip(cls.ARRAYS, shapes, strict=True)))
        if not (arrays["stdev"] > 0).all():
            raise ValueError("stdev: given numbers that are not positive")
        return cls(**arrays, actions=interface.actions)
