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

from jumping_ant.actions import ActionSet
from jumping_ant.base.archive import from_array, pack, to_array, unpack
from jumping_ant.base.errors import InputError

HEADER = "policy.json"
_TABLE = "commands.npy"

Array = NDArray[np.float64]
Header = Mapping[str, Any]
Entries = Mapping[str, bytes]
Layer = tuple[NDArray[np.float32], NDArray[np.float32]]  # weight (outputs, inputs), bias (outputs,)


class Policy(Protocol):
    """What acts: every agent's policy, whoever trained it."""

    @property
    def actions(self) -> ActionSet:
        """What it chooses from, and for how many control steps."""

    @property
    def num_observations(self) -> int | None:
        """Numbers in an observation; None where it looks at none."""

    @property
    def num_motors(self) -> int:
        """Torques that it returns."""

    def start(self, episode_seeds: Sequence[int]) -> None:
        """Begin one episode per seed; row `i` of later observations belongs to seed `i`."""

    def act(self, observations: Array) -> Array:
        """Return torques in [-1, 1], (n, num_motors), for observations (n, num_observations)."""


class UniformPolicy:
    """Actions drawn uniformly: the baseline.

    Args:
        seed: The agent's seed; with an episode's seed it determines that episode's actions.
        actions: What is drawn from.
        num_motors: Of the robot.
    """

    num_observations = None

    def __init__(self, seed: int, actions: ActionSet, num_motors: int) -> None:
        self.seed = seed
        self.actions = actions
        self.num_motors = num_motors
        self._generators: list[np.random.Generator] = []

    def start(self, episode_seeds: Sequence[int]) -> None:
        """Begin one episode per seed."""
        self._generators = [np.random.default_rng([self.seed, seed]) for seed in episode_seeds]

    def act(self, observations: Array) -> Array:
        """Return torques, shape (n, num_motors)."""
        sample = self.actions.sample
        return np.array([sample(generator, self.num_motors) for generator in self._generators])

    def to_bytes(self) -> bytes:
        """Return the policy file's content."""
        return pack(_entries("uniform", self, seed=self.seed))

    @classmethod
    def from_entries(cls, header: Header, entries: Entries) -> "UniformPolicy":
        """Build the policy from a policy file's entries."""
        return cls(int(header["seed"]), _action_set(header, entries), int(header["num_motors"]))


class OpenLoopPolicy:
    """Plays rows of a table of commands in a circle, blind to the state.

    Args:
        actions: The table, and how long each row is held.

    Raises:
        ValueError: The action set has no table.
    """

    num_observations = None

    def __init__(self, actions: ActionSet) -> None:
        if actions.table is None:
            raise ValueError("no table of commands")
        self.actions = actions
        self._table = actions.table.astype(np.float64)
        self._num_decisions = 0

    @property
    def num_motors(self) -> int:
        """Torques that it returns."""
        return self._table.shape[1]

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
        return pack(_entries("open_loop", self))

    @classmethod
    def from_entries(cls, header: Header, entries: Entries) -> "OpenLoopPolicy":
        """Build the policy from a policy file's entries."""
        return cls(_action_set(header, entries))


@dataclass(frozen=True)
class LinearPolicy:
    """A linear map of normalised observations, clipped to the torques' range.

    Attributes:
        weight: Shape (num_motors, num_observations).
        bias: Shape (num_motors,).
        mean: Subtracted from observations, shape (num_observations,).
        stdev: Observations are then divided by it, shape (num_observations,).
        weight_spread: Deviation of each weight in the distribution that the policy is the centre
            of, shape as of the weight.
        bias_spread: Deviation of each bias there, shape (num_motors,).
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

    @property
    def num_observations(self) -> int:
        """Numbers in an observation."""
        return self.weight.shape[1]

    @property
    def num_motors(self) -> int:
        """Torques that it returns."""
        return self.weight.shape[0]

    def start(self, episode_seeds: Sequence[int]) -> None:
        """Begin one episode per seed; this policy has no state."""

    def act(self, observations: Array) -> Array:
        """Return torques, shape (n, num_motors)."""
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
        return pack(_entries("linear", self) | arrays)

    @classmethod
    def from_entries(cls, header: Header, entries: Entries) -> "LinearPolicy":
        """Build the policy from a policy file's entries."""
        arrays = {name: to_array(entries[f"{name}.npy"]) for name in cls.ARRAYS}
        return cls(**arrays, actions=_action_set(header, entries))


@dataclass(frozen=True)
class _Network:
    """The network of an SB3 policy: fully connected, ReLU between layers.

    Attributes:
        factors: On the observations, shape (num_observations,).
        actions: What the outputs choose from.
        layers: Weight (outputs, inputs) and bias (outputs,) of each layer.
    """

    factors: NDArray[np.float32] = field(repr=False)
    actions: ActionSet
    layers: list[Layer] = field(repr=False)

    # Where Stable-Baselines3 keeps the layers and the observations' factors, given in subclasses:
    # prefixes of parameters' names, and a name.
    PREFIXES: ClassVar[tuple[str, ...]] = ()
    FACTORS: ClassVar[str] = ""

    @property
    def num_observations(self) -> int:
        """Numbers in an observation."""
        return len(self.factors)

    @property
    def num_motors(self) -> int:
        """Torques that it returns."""
        table = self.actions.table
        return len(self.layers[-1][1]) if table is None else table.shape[1]

    def start(self, episode_seeds: Sequence[int]) -> None:
        """Begin one episode per seed; this policy has no state."""

    def _forward(self, observations: Array) -> NDArray[np.float32]:
        """Return the outputs of the last layer, shape (n, outputs)."""
        return _affine(self._hidden(observations), self.layers[-1])

    def _hidden(self, observations: Array) -> NDArray[np.float32]:
        """Return the outputs of the last hidden layer, shape (n, units)."""
        values = observations.astype(np.float32) * self.factors
        for layer in self.layers[:-1]:
            values = np.maximum(_affine(values, layer), np.float32(0.0))
        return values

    @classmethod
    def from_entries(cls, header: Header, entries: Entries) -> Self:
        """Build the policy from a policy file's entries; tensors are all that is read."""
        state = _tensors(entries)
        layers = _layers(state, cls.PREFIXES)
        actions, outputs = _action_set(header, entries), len(layers[-1][1])
        if actions.table is not None and outputs != len(actions.table):
            raise ValueError(f"a network of {outputs} outputs instead of {len(actions.table)}")
        return cls(state[cls.FACTORS].numpy(), actions, layers, **cls._heads(state))

    @classmethod
    def _heads(cls, state: Mapping[str, Any]) -> dict[str, Any]:
        """Return the fields that a subclass adds, from the tensors by name."""
        return {}


class TanhActor(_Network):
    """TD3's actor (Fujimoto et al. 2018): torques are the tanh of a network's outputs."""

    PREFIXES: ClassVar[tuple[str, ...]] = ("actor.mu.",)
    FACTORS = "actor.features_extractor.factors"

    def act(self, observations: Array) -> Array:
        """Return torques, shape (n, num_motors)."""
        choices = np.tanh(self._forward(observations)).astype(np.float64)
        return self.actions.torques(choices)


@dataclass(frozen=True)
class GaussianActor(TanhActor):
    """SAC's actor (Haarnoja et al. 2018): torques are the tanh of a Gaussian.

    Attributes:
        log_stdev: Weight (num_motors, units) and bias (num_motors,) of the layer that gives
            the logarithm of the Gaussian's deviations.
    """

    log_stdev: Layer = field(repr=False)

    PREFIXES = ("actor.latent_pi.", "actor.mu.")
    LOG_STDEV_PREFIX = "actor.log_std."
    LOG_STDEV_RANGE = (-20.0, 2.0)  # as Stable-Baselines3 clips it

    def explore(self, observations: Array, generators: Sequence[np.random.Generator]) -> Array:
        """Draw torques as in training, shape (n, num_motors).

        Args:
            observations: Shape (n, num_observations).
            generators: Where each row's noise comes from, n of them.
        """
        mean, stdev = self.gaussian(observations)
        noise = [generator.standard_normal(self.num_motors, np.float32) for generator in generators]
        return self.actions.torques(np.tanh(mean + stdev * noise).astype(np.float64))

    def gaussian(self, observations: Array) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return mean and deviation of what tanh makes torques of, shape (n, num_motors) each."""
        hidden = self._hidden(observations)
        log_stdev = np.clip(_affine(hidden, self.log_stdev), *self.LOG_STDEV_RANGE)
        return _affine(hidden, self.layers[-1]), np.exp(log_stdev)

    @classmethod
    def _heads(cls, state: Mapping[str, Any]) -> dict[str, Any]:
        (layer,) = _layers(state, (cls.LOG_STDEV_PREFIX,))
        (mean,) = _layers(state, ("actor.mu.",))
        if layer[0].shape != mean[0].shape:
            raise ValueError(f"deviations {layer[0].shape} of means {mean[0].shape}")
        return {"log_stdev": layer}


class GreedyCommands(_Network):
    """DQN's Q-network, acting by the discrete command of the highest value."""

    PREFIXES = ("q_net.q_net.",)
    FACTORS = "q_net.features_extractor.factors"

    def act(self, observations: Array) -> Array:
        """Return torques, shape (n, num_motors)."""
        return self._torques(np.argmax(self._forward(observations), axis=1))

    def explore(
        self, observations: Array, generators: Sequence[np.random.Generator], epsilon: float
    ) -> Array:
        """Return the torques of the best command, or now and then of any, shape (n, num_motors).

        Args:
            observations: Shape (n, num_observations).
            generators: Where each row's draws come from, n of them.
            epsilon: Chance of a command drawn uniformly.
        """
        choices = np.argmax(self._forward(observations), axis=1)
        for row, generator in enumerate(generators):
            if generator.random() < epsilon:
                choices[row] = generator.integers(self.layers[-1][0].shape[0])
        return self._torques(choices)

    def _torques(self, choices: NDArray[np.int64]) -> Array:
        return self.actions.torques(choices).astype(np.float64)


def _affine(inputs: NDArray[np.float32], layer: Layer) -> NDArray[np.float32]:
    weight, bias = layer
    return np.asarray(inputs @ weight.T + bias, dtype=np.float32)


def _tensors(entries: Entries) -> dict[str, Any]:
    """Return the tensors of a Stable-Baselines3 archive, by name."""
    import torch  # takes seconds, which whoever reads no network need not wait for

    content = io.BytesIO(entries["policy.pth"])
    state: dict[str, Any] = torch.load(content, map_location="cpu", weights_only=True)
    return state


def _layers(state: Mapping[str, Any], prefixes: tuple[str, ...]) -> list[Layer]:
    """Return the layers whose parameters' names begin with one of the prefixes, in order."""
    names = [
        name.removesuffix(".weight")
        for name in state
        if name.startswith(prefixes) and name.endswith(".weight")
    ]
    return [(state[f"{name}.weight"].numpy(), state[f"{name}.bias"].numpy()) for name in names]


KINDS: dict[str, Any] = {
    "uniform": UniformPolicy,
    "open_loop": OpenLoopPolicy,
    "linear": LinearPolicy,
    "sac": GaussianActor,
    "td3": TanhActor,
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
        interface = _interface(entries)
        policy.start([0])
        shape = policy.act(np.zeros((1, interface.num_observations or 1))).shape
    except Exception as error:  # whatever a damaged file provokes, it is the file's fault
        raise InputError(
            f"policy file: given {len(content)} bytes that are not a policy "
            f"({type(error).__name__}: {error}); allowed: a policy.zip that `dvc repro` trained"
        ) from error
    if shape != (1, interface.num_motors):
        raise InputError(
            f"policy file: given torques of shape {shape}, allowed: {(1, interface.num_motors)}"
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


@dataclass(frozen=True)
class Interface:
    """What goes into a policy and comes out of it, as its file's header says.

    Attributes:
        actions: What it chooses from, and for how many control steps.
        num_observations: Numbers in an observation; None where it looks at none.
        num_motors: Torques that it returns.
    """

    actions: ActionSet
    num_observations: int | None
    num_motors: int


def read_interface(path: Path) -> Interface:
    """Read what goes into a policy and comes out of it, without reading the policy.

    Raises:
        InputError: It is missing or not a policy file.
    """
    try:
        return _interface(unpack(path.read_bytes()))
    except Exception as error:  # as in `load`
        raise InputError(f"{path}: not a policy file ({error}); `dvc repro` trains it") from error


def network_entries(algorithm: str, interface: Interface) -> dict[str, bytes]:
    """Return the entries that turn a Stable-Baselines3 archive into a policy file."""
    return _entries(algorithm, interface)


def _entries(kind: str, interface: Interface | Policy, **fields: int) -> dict[str, bytes]:
    """Return the header of a policy file, and the table of commands if there is one."""
    actions = interface.actions
    header = {
        "format": 3,
        "kind": kind,
        "hold": actions.hold,
        "amplitude": actions.amplitude,
        "num_observations": interface.num_observations,
        "num_motors": interface.num_motors,
        **fields,
    }
    entries = {HEADER: json.dumps(header).encode()}
    return entries if actions.table is None else entries | {_TABLE: from_array(actions.table)}


def _interface(entries: Entries) -> Interface:
    header = json.loads(entries[HEADER])
    observations = header["num_observations"]
    return Interface(
        _action_set(header, entries),
        None if observations is None else int(observations),
        int(header["num_motors"]),
    )


def _action_set(header: Header, entries: Entries) -> ActionSet:
    """Read an action set from a policy file's entries."""
    table = to_array(entries[_TABLE]) if _TABLE in entries else None
    if table is not None and (table.ndim != 2 or not table.size):
        raise ValueError(f"a table of commands of shape {table.shape}")
    if table is not None and not (np.abs(table) <= 1).all():  # a NaN is no number up to 1
        raise ValueError("a table of commands beyond the peak torque")
    hold, amplitude = int(header["hold"]), float(header["amplitude"])
    if hold < 1:
        raise ValueError(f"actions held for {hold} control steps")
    if not 0 < amplitude <= 1:
        raise ValueError(f"torques of {amplitude} times the peak torque")
    return ActionSet(table, amplitude, hold)
