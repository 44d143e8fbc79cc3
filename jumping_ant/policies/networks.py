"""Neural network policies, trained by Stable-Baselines3 or in the same way."""

import io
import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from jumping_ant.actions import ActionSet
from jumping_ant.base.archive import Archive
from jumping_ant.policies.policy import (
    Array,
    Entries,
    Header,
    action_set,
)

Layer = tuple[NDArray[np.float32], NDArray[np.float32]]  # weight (outputs, inputs), bias (outputs,)


@dataclass(frozen=True)
class _Network:
    """The network of an SB3 policy: fully connected, ReLU between layers.

    Attributes:
        factors: Factors on the observations, shape (num_observations,).
        actions: The action set that the outputs choose from.
        layers: Weight (outputs, inputs) and bias (outputs,) of each layer.
    """

    factors: NDArray[np.float32] = field(repr=False)
    actions: ActionSet
    layers: list[Layer] = field(repr=False)

    # Where Stable-Baselines3 stores the layers (prefixes of parameter names) and the observations'
    # factors (a parameter name); subclasses set them.
    PREFIXES: ClassVar[tuple[str, ...]] = ()
    FACTORS: ClassVar[str] = ""

    @property
    def num_observations(self) -> int:
        """Number of values in an observation."""
        return len(self.factors)

    @property
    def num_motors(self) -> int:
        """Number of torques that the policy returns."""
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
        """Build the policy from a policy file's entries; only tensors are read."""
        state = _tensors(entries)
        layers = _layers(state, cls.PREFIXES)
        actions, outputs = action_set(header, entries), len(layers[-1][1])
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
            the logarithm of the Gaussian's standard deviations.
    """

    log_stdev: Layer = field(repr=False)

    PREFIXES = ("actor.latent_pi.", "actor.mu.")
    LOG_STDEV_PREFIX = "actor.log_std."
    LOG_STDEV_RANGE = (-20.0, 2.0)  # as Stable-Baselines3 clips it

    def explore(self, observations: Array, generators: Sequence[np.random.Generator]) -> Array:
        """Draw torques as in training, shape (n, num_motors).

        Args:
            observations: Shape (n, num_observations).
            generators: Generator of each row's noise, n of them.
        """
        mean, stdev = self.gaussian(observations)
        noise = [generator.standard_normal(self.num_motors, np.float32) for generator in generators]
        return self.actions.torques(np.tanh(mean + stdev * noise).astype(np.float64))

    def gaussian(self, observations: Array) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return mean and standard deviation before the tanh, shape (n, num_motors) each."""
        hidden = self._hidden(observations)
        log_stdev = np.clip(_affine(hidden, self.log_stdev), *self.LOG_STDEV_RANGE)
        return _affine(hidden, self.layers[-1]), np.exp(log_stdev)

    @classmethod
    def _heads(cls, state: Mapping[str, Any]) -> dict[str, Any]:
        (layer,) = _layers(state, (cls.LOG_STDEV_PREFIX,))
        (mean,) = _layers(state, ("actor.mu.",))
        if layer[0].shape != mean[0].shape:
            raise ValueError(f"deviations of shape {layer[0].shape} for means of {mean[0].shape}")
        return {"log_stdev": layer}


class GreedyCommands(_Network):
    """DQN's Q-network, which acts with the command of the highest value."""

    PREFIXES = ("q_net.q_net.",)
    FACTORS = "q_net.features_extractor.factors"

    def act(self, observations: Array) -> Array:
        """Return torques, shape (n, num_motors)."""
        return self._torques(np.argmax(self._forward(observations), axis=1))

    def explore(
        self, observations: Array, generators: Sequence[np.random.Generator], epsilon: float
    ) -> Array:
        """Return the torques of the best or of a random command, shape (n, num_motors).

        Args:
            observations: Shape (n, num_observations).
            generators: Generator of each row's draws, n of them.
            epsilon: Probability of a command drawn uniformly.
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
    import torch  # takes seconds, so imported only to read a network

    content = entries["policy.pth"]
    archive = Archive(content)
    sizes = Counter(archive.size(name) for name in archive)
    state: dict[str, Any] = torch.load(io.BytesIO(content), map_location="cpu", weights_only=True)
    for name, tensor in state.items():
        # A tensor says how large its storage is and how it lies in it, and torch believes it.
        storage = tensor.untyped_storage().nbytes()
        if not sizes[storage] or not tensor.is_contiguous():
            raise ValueError(f"{name}: {tuple(tensor.shape)} numbers in {storage} bytes")
    return state


def _layers(state: Mapping[str, Any], prefixes: tuple[str, ...]) -> list[Layer]:
    """Return the layers whose parameters' names begin with one of the prefixes, in order."""
    names = [
        name.removesuffix(".weight")
        for name in state
        if name.startswith(prefixes) and name.endswith(".weight")
    ]
    layers = [(state[f"{name}.weight"].numpy(), state[f"{name}.bias"].numpy()) for name in names]
    for weight, bias in layers:
        if weight.ndim != 2 or bias.shape != weight.shape[:1]:
            raise ValueError(f"a layer of weights {weight.shape} and biases {bias.shape}")
    for (before, _), (after, _) in itertools.pairwise(layers):
        if after.shape[1] != before.shape[0]:
            raise ValueError(f"a layer of {after.shape} after one of {before.shape}")
    return layers
