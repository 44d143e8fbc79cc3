"""Trained policies: observations in, torques out, and files that hold no code.

A policy file is a zip archive. Its entry `policy.json` says which kind of policy it is; the arrays
stand beside it, as `.npy` entries or, for agents of Stable-Baselines3, in the entries that
Stable-Baselines3 itself writes (so that `SAC.load` and `DQN.load` read the same file). Only numbers
are read from it: the structure comes from the classes here. Equal policies are equal bytes.

A policy decides every `hold` control steps; its torques are held in between. Whoever steps the
simulation sees to that.
"""

import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from jumping_ant.archive import from_array, pack, to_array, unpack
from jumping_ant.errors import InputError
from jumping_ant.task import NUM_ACTIONS, ActionSet

HEADER = "policy.json"
_TABLE = "commands.npy"
NUM_OBSERVATIONS = 27
FIRST_VELOCITY = 13  # observations before it are positions, from it on velocities

Array = NDArray[np.float64]
Header = Mapping[str, Any]
Entries = Mapping[str, bytes]


class Policy(Protocol):
    """What acts: every agent's policy, whoever trained it."""

    @property
    def actions(self) -> ActionSet:
        """What it chooses from, and for how many control steps."""

    def start(self, episode_seeds: Sequence[int]) -> None:
        """Begin one episode per seed; row `i` of later observations belongs to seed `i`."""

    def act(self, observations: Array) -> Array:
        """Return torques in [-1, 1], shape (n, 8), for observations of shape (n, 27)."""


class UniformPolicy:
    """Actions drawn uniformly: the baseline.

    Args:
        seed: The agent's seed; with an episode's seed it determines that episode's actions.
        actions: What is drawn from.
    """

    def __init__(self, seed: int, actions: ActionSet) -> None:
        self.seed = seed
        self.actions = actions
        self._generators: list[np.random.Generator] = []

    def start(self, episode_seeds: Sequence[int]) -> None:
        """Begin one episode per seed."""
        self._generators = [np.random.default_rng([self.seed, seed]) for seed in episode_seeds]

    def act(self, observations: Array) -> Array:
        """Return torques, shape (n, 8)."""
        return np.array([self.actions.sample(generator) for generator in self._generators])

    def to_bytes(self) -> bytes:
        """Return the policy file's content."""
        return pack(_entries("uniform", self.actions, seed=self.seed))

    @classmethod
    def from_entries(cls, header: Header, entries: Entries) -> "UniformPolicy":
        """Build the policy from a policy file's entries."""
        return cls(int(header["seed"]), _action_set(header, entries))


class OpenLoopPolicy:
    """Plays rows of a table of commands in a circle, blind to the state.

    Args:
        actions: The table, and how long each row is held.
    """

    def __init__(self, actions: ActionSet) -> None:
        self.actions = actions
        self._num_decisions = 0

    def start(self, episode_seeds: Sequence[int]) -> None:
        """Begin one episode per seed, each with the first row."""
        self._num_decisions = 0

    def act(self, observations: Array) -> Array:
        """Return torques, shape (n, 8)."""
        assert self.actions.table is not None
        row = self.actions.table[self._num_decisions % len(self.actions.table)]
        self._num_decisions += 1
        return np.tile(row.astype(np.float64), (len(observations), 1))

    def to_bytes(self) -> bytes:
        """Return the policy file's content."""
        return pack(_entries("open_loop", self.actions))

    @classmethod
    def from_entries(cls, header: Header, entries: Entries) -> "OpenLoopPolicy":
        """Build the policy from a policy file's entries."""
        actions = _action_set(header, entries)
        if actions.table is None:
            raise ValueError("no table of commands")
        return cls(actions)


@dataclass(frozen=True)
class LinearPolicy:
    """A linear map of normalised observations, clipped to the torques' range.

    Attributes:
        weight: Shape (8, 27).
        bias: Shape (8,).
        mean: Subtracted from observations, shape (27,).
        stdev: Observations are then divided by it, shape (27,).
        weight_spread: Deviation of each weight in the distribution that the policy is the centre
            of, shape (8, 27).
        bias_spread: Deviation of each bias there, shape (8,).
        actions: What the outputs, clipped to [-1, 1], stand for.
    """

    weight: NDArray[np.float32]
    bias: NDArray[np.float32]
    mean: NDArray[np.float32]
    stdev: NDArray[np.float32]
    weight_spread: NDArray[np.float32]
    bias_spread: NDArray[np.float32]
    actions: ActionSet

    ARRAYS: ClassVar = ("weight", "bias", "mean", "stdev", "weight_spread", "bias_spread")

    def start(self, episode_seeds: Sequence[int]) -> None:
        """Begin one episode per seed; this policy has no state."""

    def act(self, observations: Array) -> Array:
        """Return torques, shape (n, 8)."""
        normalized = (observations.astype(np.float32) - self.mean) / self.stdev
        choices = np.clip(normalized @ self.weight.T + self.bias, -1.0, 1.0)
        return self.actions.torques(choices.astype(np.float64))

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
        arrays = {f"{name}.npy": from_array(getattr(self, name)) for name in self.ARRAYS}
        return pack(_entries("linear", self.actions) | arrays)

    @classmethod
    def from_entries(cls, header: Header, entries: Entries) -> "LinearPolicy":
        """Build the policy from a policy file's entries."""
        arrays = {name: to_array(entries[f"{name}.npy"]) for name in cls.ARRAYS}
        return cls(**arrays, actions=_action_set(header, entries))


@dataclass(frozen=True)
class _Network:
    """The network of an SB3 policy: fully connected, ReLU between layers.

    Attributes:
        velocity_scale: Factor on the observed velocities.
        actions: What the outputs choose from.
        layers: Weight (outputs, inputs) and bias (outputs,) of each layer.
    """

    velocity_scale: float
    actions: ActionSet
    layers: list[tuple[NDArray[np.float32], NDArray[np.float32]]] = field(repr=False)

    # Where Stable-Baselines3 keeps the layers, given in subclasses: prefixes of parameter names.
    PREFIXES: ClassVar[tuple[str, ...]] = ()

    def start(self, episode_seeds: Sequence[int]) -> None:
        """Begin one episode per seed; this policy has no state."""

    def _forward(self, observations: Array) -> NDArray[np.float32]:
        """Return the outputs of the last layer, shape (n, outputs)."""
        values: NDArray[Any] = observations.astype(np.float32)
        values = values * velocity_factors(self.velocity_scale)
        for weight, bias in self.layers[:-1]:
            values = np.maximum(values @ weight.T + bias, 0.0)
        weight, bias = self.layers[-1]
        return np.asarray(values @ weight.T + bias, dtype=np.float32)

    @classmethod
    def from_entries(cls, header: Header, entries: Entries) -> Self:
        """Build the policy from a policy file's entries; tensors are all that is read."""
        import torch  # takes seconds, which whoever reads no network need not wait for

        state = torch.load(io.BytesIO(entries["policy.pth"]), map_location="cpu", weights_only=True)
        names = [
            name.removesuffix(".weight")
            for name in state
            if name.startswith(cls.PREFIXES) and name.endswith(".weight")
        ]
        pairs = [(state[f"{name}.weight"], state[f"{name}.bias"]) for name in names]
        layers = [(weight.numpy(), bias.numpy()) for weight, bias in pairs]
        actions = _action_set(header, entries)
        expected = NUM_ACTIONS if actions.table is None else len(actions.table)
        if (outputs := layers[-1][0].shape[0]) != expected:
            raise ValueError(f"a network of {outputs} outputs instead of {expected}")
        return cls(float(header["velocity_scale"]), actions, layers)


class GaussianActor(_Network):
    """SAC's actor, acting by the mean of its squashed Gaussian (Haarnoja et al. 2018)."""

    PREFIXES = ("actor.latent_pi.", "actor.mu.")

    def act(self, observations: Array) -> Array:
        """Return torques, shape (n, 8)."""
        choices = np.tanh(self._forward(observations)).astype(np.float64)
        return self.actions.torques(choices)


class GreedyCommands(_Network):
    """DQN's Q-network, acting by the discrete command of the highest value."""

    PREFIXES = ("q_net.q_net.",)

    def act(self, observations: Array) -> Array:
        """Return torques, shape (n, 8)."""
        choices = np.argmax(self._forward(observations), axis=1)
        return self.actions.torques(choices).astype(np.float64)


KINDS: dict[str, Any] = {
    "uniform": UniformPolicy,
    "open_loop": OpenLoopPolicy,
    "linear": LinearPolicy,
    "sac": GaussianActor,
    "dqn": GreedyCommands,
}


def load(content: bytes) -> Policy:
    """Read a policy file's content.

    Raises:
        InputError: It is not a policy file, or a damaged one.
    """
    try:
        entries = unpack(content)
        header = json.loads(entries[HEADER])
        policy: Policy = KINDS[header["kind"]].from_entries(header, entries)
        policy.start([0])
        shape = policy.act(np.zeros((1, NUM_OBSERVATIONS))).shape
    except Exception as error:  # whatever a damaged file provokes, it is the file's fault
        raise InputError(
            f"policy file: given {len(content)} bytes that are not a policy "
            f"({type(error).__name__}: {error}); allowed: a policy.zip that `dvc repro` trained"
        ) from error
    if shape != (1, NUM_ACTIONS):
        raise InputError(
            f"policy file: given torques of shape {shape}, allowed: {(1, NUM_ACTIONS)}"
        )
    return policy


def load_file(path: Path) -> Policy:
    """Read a policy file.

    Raises:
        InputError: It is missing or not a policy file.
    """
    try:
        return load(path.read_bytes())
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; `dvc repro` trains it") from error


def velocity_factors(velocity_scale: float) -> NDArray[np.float32]:
    """Return the factor of each observation: 1 for positions, the scale for velocities, (27,)."""
    factors = np.ones(NUM_OBSERVATIONS, dtype=np.float32)
    factors[FIRST_VELOCITY:] = velocity_scale
    return factors


def network_entries(algorithm: str, actions: ActionSet, velocity_scale: float) -> dict[str, bytes]:
    """Return the entries that turn a Stable-Baselines3 archive into a policy file."""
    return _entries(algorithm, actions, velocity_scale=velocity_scale)


def _entries(kind: str, actions: ActionSet, **fields: float) -> dict[str, bytes]:
    """Return the header of a policy file, and the table of commands if there is one."""
    header = {
        "format": 2,
        "kind": kind,
        "hold": actions.hold,
        "amplitude": actions.amplitude,
        **fields,
    }
    entries = {HEADER: json.dumps(header).encode()}
    return entries if actions.table is None else entries | {_TABLE: from_array(actions.table)}


def _action_set(header: Header, entries: Entries) -> ActionSet:
    """Read an action set from a policy file's entries."""
    table = to_array(entries[_TABLE]) if _TABLE in entries else None
    if table is not None and (table.ndim != 2 or table.shape[1] != NUM_ACTIONS or not len(table)):
        raise ValueError(f"a table of commands of shape {table.shape}")
    if table is not None and not (np.abs(table) <= 1).all():  # a NaN is no number up to 1
        raise ValueError("a table of commands beyond the peak torque")
    hold, amplitude = int(header["hold"]), float(header["amplitude"])
    if hold < 1:
        raise ValueError(f"actions held for {hold} control steps")
    if not 0 < amplitude <= 1:
        raise ValueError(f"torques of {amplitude} times the peak torque")
    return ActionSet(table, amplitude, hold)
