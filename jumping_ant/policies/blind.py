"""Policies that ignore observations: random actions, or a fixed cycle of commands."""

from collections.abc import Sequence

import numpy as np

from jumping_ant.actions import ActionSet
from jumping_ant.base.archive import pack
from jumping_ant.policies.policy import (
    Array,
    Entries,
    Header,
    Interface,
    action_set,
    header_entries,
)


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
        return pack(header_entries("uniform", interface, seed=self.seed))

    @classmethod
    def from_entries(cls, header: Header, entries: Entries) -> "UniformPolicy":
        """Build the policy from a policy file's entries."""
        return cls(int(header["seed"]), action_set(header, entries), int(header["num_motors"]))


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
        interface = Interface(self.actions, None, self._table.shape[1])
        return pack(header_entries("open_loop", interface))

    @classmethod
    def from_entries(cls, header: Header, entries: Entries) -> "OpenLoopPolicy":
        """Build the policy from a policy file's entries."""
        return cls(action_set(header, entries))
