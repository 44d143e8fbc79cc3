"""Neural network policies, trained by Stable-Baselines3 or in the same way."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from jumping_ant.policies import tensors
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.policy import Array, Entries, Interface, Stateless

Layer = tuple[NDArray[np.float32], NDArray[np.float32]]  # weight (outputs, inputs), bias (outputs,)
State = dict[str, NDArray[Any]]  # a network's numbers by name


@dataclass(frozen=True)
class Network(Stateless):
    """The network of an SB3 policy: fully connected, ReLU between layers."""

    factors: NDArray[np.float32] = field(repr=False)  # on the observations, (num_observations,)
    actions: ActionSet
    layers: list[Layer] = field(repr=False)

    # Where Stable-Baselines3 stores the layers (prefixes of parameter names) and the observations'
    # factors (a parameter name); subclasses set them.
    PREFIXES: ClassVar[tuple[str, ...]] = ()
    FACTORS: ClassVar[str] = ""

    def _outputs(self, observations: Array) -> NDArray[np.float32]:
        """Return the outputs of the last layer, shape (n, outputs), row by row (see `Policy`)."""
        return self._forward(observations[:, None])[:, 0]

    def _forward(self, observations: Array) -> NDArray[np.float32]:
        """Return the outputs of the last layer, shape (..., outputs)."""
        return _affine(self._hidden(observations), self.layers[-1])

    def _hidden(self, observations: Array) -> NDArray[np.float32]:
        """Return the outputs of the last hidden layer, shape (..., units)."""
        values = observations.astype(np.float32) * self.factors
        for layer in self.layers[:-1]:
            values = self._activate(_affine(values, layer))
        return values

    def _activate(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.maximum(values, np.float32(0.0))

    @classmethod
    def from_entries(cls, interface: Interface, entries: Entries) -> Self:
        """Build the policy from a policy file's entries; only tensors are read."""
        actions = interface.actions
        state = cls._folded(tensors.read(entries["policy.pth"]), actions)
        layers = _layers(state, cls.PREFIXES)
        outputs = len(layers[-1][1])
        if actions.table is not None and outputs != len(actions.table):
            raise ValueError(f"a network of {outputs} outputs instead of {len(actions.table)}")
        factors = state[cls.FACTORS]
        if factors.shape != (layers[0][0].shape[1],) or not np.isfinite(factors).all():
            raise ValueError("factors that are not finite, or not one for each observation")
        return cls(factors, actions, layers, **cls._heads(state))

    @classmethod
    def _folded(cls, state: State, actions: ActionSet) -> State:
        """Return the same function with layers only; a subclass folds what else it has."""
        return state

    @classmethod
    def _heads(cls, state: State) -> dict[str, Any]:
        """Return the fields that a subclass adds, from the tensors by name."""
        return {}


class TanhActor(Network):
    """TD3's actor (Fujimoto et al. 2018): torques are the tanh of a network's outputs."""

    PREFIXES: ClassVar[tuple[str, ...]] = ("actor.mu.",)
    FACTORS = "actor.features_extractor.factors"

    def act(self, observations: Array) -> Array:
        """Return torques, shape (n, num_motors)."""
        choices = np.tanh(self._outputs(observations)).astype(np.float64)
        return self.actions.torques(choices)


@dataclass(frozen=True)
class GaussianActor(TanhActor):
    """SAC's actor (Haarnoja et al. 2018): torques are the tanh of a Gaussian."""

    log_stdev: Layer = field(repr=False)  # gives the logarithm of the standard deviations

    PREFIXES = ("actor.latent_pi.", "actor.mu.")
    LOG_STDEV_PREFIX = "actor.log_std."
    LOG_STDEV_RANGE = (-20.0, 2.0)  # as Stable-Baselines3 clips it

    def explore(self, observations: Array, generators: Sequence[np.random.Generator]) -> Array:
        """Draw torques as in training, (n, num_motors), with a generator for each row."""
        mean, stdev = self.gaussian(observations)
        noise = [
            generator.standard_normal(len(self.log_stdev[1]), np.float32)
            for generator in generators
        ]
        return self.actions.torques(np.tanh(mean + stdev * noise).astype(np.float64))

    def gaussian(self, observations: Array) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return mean and standard deviation before the tanh, shape (n, num_motors) each."""
        hidden = self._hidden(observations)
        log_stdev = np.clip(_affine(hidden, self.log_stdev), *self.LOG_STDEV_RANGE)
        return _affine(hidden, self.layers[-1]), np.exp(log_stdev)

    @classmethod
    def _heads(cls, state: State) -> dict[str, Any]:
        (layer,) = _layers(state, (cls.LOG_STDEV_PREFIX,))
        (mean,) = _layers(state, ("actor.mu.",))
        if layer[0].shape != mean[0].shape:
            raise ValueError(f"deviations of shape {layer[0].shape} for means of {mean[0].shape}")
        return {"log_stdev": layer}


class NormalizedActor(GaussianActor):
    """CrossQ's actor (Bhatt et al. 2024): SAC's with batch renormalisation before each layer.

    Once trained, a normalisation is a factor and a shift of each input, which the layer after it
    takes over.
    """

    EPSILON = 0.001  # added to variances, as SB3-Contrib does

    @classmethod
    def _folded(cls, state: State, actions: ActionSet) -> State:
        modules = [name.rpartition(".")[0] for name in state if name.startswith("actor.latent_pi.")]
        factors, shifts = np.ones(()), np.zeros(())
        folded = dict(state)
        for module in [*dict.fromkeys(modules), "actor.mu", "actor.log_std"]:
            if f"{module}.ra_var" in state:
                scale, bias, mean, variance = (
                    state[f"{module}.{name}"].astype(np.float64)
                    for name in ("scale", "bias", "ra_mean", "ra_var")
                )
                factors = scale / np.sqrt(variance + cls.EPSILON)
                shifts = bias - factors * mean
            else:
                weight, bias = state[f"{module}.weight"], state[f"{module}.bias"]
                folded[f"{module}.weight"] = (weight * factors).astype(np.float32)
                folded[f"{module}.bias"] = (bias + weight @ shifts).astype(np.float32)
        return folded


class GreedyCommands(Network):
    """DQN's Q-network, which acts with the command, or the levels, of the highest value."""

    PREFIXES = ("q_net.q_net.",)
    FACTORS = "q_net.features_extractor.factors"

    def act(self, observations: Array) -> Array:
        """Return torques, shape (n, num_motors)."""
        return self._torques(self.actions.best(self._outputs(observations)))

    def explore(
        self, observations: Array, generators: Sequence[np.random.Generator], epsilon: float
    ) -> Array:
        """Return the torques of the best command, or of a random one with probability `epsilon`."""
        choices = np.argmax(self._forward(observations), axis=1)
        for row, generator in enumerate(generators):
            if generator.random() < epsilon:
                choices[row] = generator.integers(self.layers[-1][0].shape[0])
        return self._torques(choices)

    def _torques(self, choices: NDArray[np.int64]) -> Array:
        return self.actions.torques(choices).astype(np.float64)


class QuantileCommands(GreedyCommands):
    """QR-DQN's network (Dabney et al. 2018): a command's value is the mean of its quantiles."""

    PREFIXES = ("quantile_net.quantile_net.",)
    FACTORS = "quantile_net.features_extractor.factors"

    @classmethod
    def _folded(cls, state: State, actions: ActionSet) -> State:
        last = [name for name in state if name.startswith(cls.PREFIXES)][-1].rpartition(".")[0]
        num_commands = 1 if actions.table is None else len(actions.table)
        means = {
            name: state[name].reshape(-1, num_commands, *state[name].shape[1:]).mean(axis=0)
            for name in (f"{last}.weight", f"{last}.bias")
        }
        return state | means


class ActorCritic(Network):
    """The actor of A2C and PPO: a Gaussian's mean, or the most probable command or levels."""

    PREFIXES = ("mlp_extractor.policy_net.", "action_net.")
    FACTORS = "features_extractor.factors"

    def act(self, observations: Array) -> Array:
        """Return torques, shape (n, num_motors)."""
        outputs = self._outputs(observations)
        is_gaussian = self.actions.chooses_torques
        choices = self.actions.choices(outputs) if is_gaussian else self.actions.best(outputs)
        return self.actions.torques(choices).astype(np.float64)

    def _activate(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.tanh(values)


def _affine(inputs: NDArray[np.float32], layer: Layer) -> NDArray[np.float32]:
    weight, bias = layer
    return np.asarray(inputs @ weight.T + bias, dtype=np.float32)


def _layers(state: State, prefixes: tuple[str, ...]) -> list[Layer]:
    """Return the layers whose parameters' names begin with one of the prefixes, in order."""
    names = [
        name.removesuffix(".weight")
        for name in state
        if name.startswith(prefixes) and name.endswith(".weight")
    ]
    layers = [(state[f"{name}.weight"], state[f"{name}.bias"]) for name in names]
    for weight, bias in layers:
        is_finite = np.isfinite(weight).all() and np.isfinite(bias).all()
        if weight.ndim != 2 or bias.shape != weight.shape[:1] or not is_finite:
            raise ValueError(f"a layer of weights {weight.shape} and biases {bias.shape}, finite?")
    for (before, _), (after, _) in itertools.pairwise(layers):
        if after.shape[1] != before.shape[0]:
            raise ValueError(f"a layer of {after.shape} after one of {before.shape}")
    return layers
