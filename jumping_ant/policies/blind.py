"""Policies that ignore observations: random actions, a fixed cycle of commands, oscillators."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.policy import HEADER, Array, Entries, Interface, arrays_of, to_file


class UniformPolicy:
    """Actions drawn uniformly, from the agent's seed and the episode's: the baseline."""

    def __init__(self, seed: int, actions: ActionSet, num_motors: int) -> None:
        self.seed = seed
        self.actions = actions
        self._num_motors = num_motors
        self._generators: list[np.random.Generator] = []

    def start(self, episode_seeds: Sequence[int]) -> None:
        """Begin one episode per seed."""
        self._generators = [np.random.default_rng([self.seed, seed]) for seed in episode_seeds]

    def act(self, observations: Array) -> Array:
        """Return torques, shape (n, num_motors)."""
        sample = self.actions.sample
        return np.array([sample(generator, self._num_motors) for generator in self._generators])

    def to_bytes(self) -> bytes:
        """Return the policy file's content."""
        interface = Interface(self.actions, None, self._num_motors)
        return to_file("uniform", interface, seed=self.seed)

    @classmethod
    def from_entries(cls, interface: Interface, entries: Entries) -> "UniformPolicy":
        """Build the policy from a policy file's entries."""
        seed = int(json.loads(entries[HEADER])["seed"])
        return cls(seed, interface.actions, interface.num_motors)


class OpenLoopPolicy:
    """Cycles through the rows of a table of commands, ignoring the state."""

    def __init__(self, actions: ActionSet) -> None:
        if actions.table is None:
            raise ValueError("no table of commands")
        self.actions = actions
        self._table = actions.table.astype(np.float64)
        self._num_decisions = 0

    def start(self, episode_seeds: Sequence[int]) -> None:
        """Begin one episode per seed, each with the first row."""
        self._num_decisions = 0

    def act(self, observations: Array) -> Array:
        """Return torques, shape (n, num_motors)."""
        row = self._table[self._num_decisions % len(self._table)]
        self._num_decisions += 1
        return np.tile(row, (len(observations), 1))

    def to_bytes(self) -> bytes:
        """Return the policy file's content."""
        return to_file("open_loop", Interface(self.actions, None, self._table.shape[1]))

    @classmethod
    def from_entries(cls, interface: Interface, entries: Entries) -> "OpenLoopPolicy":
        """Build the policy from a policy file's entries."""
        return cls(interface.actions)


@dataclass(frozen=True)
class Oscillators:
    """An oscillator for each output of one policy, or of n policies that play side by side.

    Raffin et al. 2024, "An open-loop baseline for reinforcement learning locomotion tasks", section
    3: an output is amplitude * sin(angle + phase) + offset, and its angle advances by one of two
    speeds that all share, the first while the sine is positive. There, outputs are positions for a
    controller that measures the joints; here, they are torques.
    """

    amplitudes: Array  # (num_outputs,) or (n, num_outputs)
    phases: Array  # [rad] at the start, of the same shape
    offsets: Array  # of the same shape
    speeds: Array  # [rad/decision], (2,) or (n, 2)

    ARRAYS: ClassVar = ("amplitudes", "phases", "offsets", "speeds")

    def outputs(self, angles: Array) -> tuple[Array, Array]:
        """Return the outputs at angles that include the phases [rad], and the next angles."""
        sines = np.sin(angles)
        speeds = np.where(sines > 0, self.speeds[..., :1], self.speeds[..., 1:])
        return self.amplitudes * sines + self.offsets, angles + speeds


class OscillatorPolicy:
    """Oscillators that drive all motors and ignore the state."""

    def __init__(self, oscillators: Oscillators, actions: ActionSet) -> None:
        self.actions = actions
        self._oscillators = oscillators
        self._angles = oscillators.phases

    def start(self, episode_seeds: Sequence[int]) -> None:
        """Begin one episode per seed."""
        self._angles = self._oscillators.phases

    def act(self, observations: Array) -> Array:
        """Return torques, shape (n, num_motors)."""
        outputs, self._angles = self._oscillators.outputs(self._angles)
        torques = self.actions.torques(self.actions.choices(outputs[None]))
        return np.tile(torques, (len(observations), 1))

    def to_bytes(self) -> bytes:
        """Return the policy file's content."""
        num_motors = self.actions.num_motors(len(self._oscillators.phases))
        interface = Interface(self.actions, None, num_motors)
        arrays = {name: getattr(self._oscillators, name) for name in Oscillators.ARRAYS}
        return to_file("oscillator", interface, arrays)

    @classmethod
    def from_entries(cls, interface: Interface, entries: Entries) -> "OscillatorPolicy":
        """Build the policy from a policy file's entries."""
        each = (interface.actions.num_outputs(interface.num_motors),)
        arrays = arrays_of(entries, amplitudes=each, phases=each, offsets=each, speeds=(2,))
        return cls(Oscillators(**arrays), interface.actions)
