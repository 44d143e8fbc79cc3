"""Stable-Baselines3's DQN and SAC with leaner updates: the same mathematics, fewer operations.

Each class replaces `train`, the gradient steps; the weights equal SB3's up to rounding. It omits
work whose result is unused: gradients of networks that a loss does not train, the critic's backward
pass where it is not the smaller of the two, features for each network, copies, and bookkeeping.

The networks are those of SB3's `MlpPolicy` with ReLU; a feature extractor, if any, has no
parameters and is the same for all of them.
"""

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import DQN, SAC
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.policies import BaseModel
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.sac.policies import LOG_STD_MAX, LOG_STD_MIN, Actor
from torch import Tensor, nn
from torch.nn import functional
from torch.optim import Adam

from jumping_ant.agents.off_policy.lean.adam import FlatAdam, denormals_flushed, flatten
from jumping_ant.agents.off_policy.lean.mlp import MLP, Pass
from jumping_ant.agents.off_policy.lean.replay import BatchedReplayBuffer, Batches

TANH_EPSILON = 1e-6  # SB3's guard against the logarithm of zero
LOG_SQRT_2PI = 0.5 * math.log(2 * math.pi)

Extraction = Callable[[Tensor], Tensor]
ActorPasses = tuple[Pass, Pass, Pass]  # of the hidden layers, the mean, the deviation


class _Lean(OffPolicyAlgorithm):
    """A learner whose attributes beyond SB3's are not part of policy files."""

    replay_buffer: BatchedReplayBuffer

    def _setup_model(self) -> None:
        self.replay_buffer = BatchedReplayBuffer(
            self.buffer_size,
            self.observation_space,
            self.action_space,
            self.device,
            self.n_envs,
            n_steps=self.n_steps,
            gamma=self.gamma,
        )
        super()._setup_model()
        theirs = set(vars(self))
        self._set_up_passes()
        self._unsaved = ["_unsaved", *(vars(self).keys() - theirs)]

    @abstractmethod
    def _set_up_passes(self) -> None:
        """Set what `train` computes with, from SB3's networks and optimisers."""

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), *self._unsaved]


class LeanDQN(_Lean, DQN):
    """DQN (Mnih et al. 2015) that learns as SB3's does.

    A choice may have several parts, the values of whose options lie one part after the other in the
    network's outputs. A choice's value is the mean over its parts; a command is a single part.
    """

    def _set_up_passes(self) -> None:
        self._adam = FlatAdam(cast(Adam, self.policy.optimizer))
        self._target_values = flatten(list(self.q_net_target.parameters()))
        self._extract = _extraction(self.q_net)
        self._online = _mlp(self.q_net.q_net)
        self._target = _mlp(self.q_net_target.q_net)
        self._learning_pass, self._target_pass, self._acting_pass = Pass(), Pass(), Pass()

    @property
    def vectors(self) -> dict[str, Tensor]:
        """All tensors that learning modifies, by name."""
        return {"target": self._target_values, **self._adam.vectors}

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = False,
    ) -> tuple[NDArray[np.int64], Any]:
        """Choose commands, (n,), or other choices, (n, parts), for observations of n environments.

        SB3 decides once for all environments whether to explore; here this is decided for each
        environment, and each part of its choice. With one environment and one part the two choose
        alike.
        """
        shape = (len(observation), *cast(tuple[int, ...], self.action_space.shape))
        is_random = np.zeros(shape, dtype=np.bool_)
        if not deterministic:
            is_random = np.random.rand(*shape) < self.exploration_rate
        if is_random.all():
            return np.array([self.action_space.sample() for _ in is_random]), state
        features = self._extract(torch.from_numpy(observation))
        values = self._by_part(self._online.forward(features, self._acting_pass))
        actions = values.argmax(2).numpy().reshape(shape)
        for index in np.nonzero(is_random.reshape(len(observation), -1).any(axis=1))[0]:
            sample = self.action_space.sample()
            actions[index] = np.where(is_random[index], sample, actions[index])
        return actions, state

    def _by_part(self, values: Tensor) -> Tensor:
        """Return a network's outputs, (n, outputs), as values of shape (n, parts, options)."""
        return values.view(len(values), math.prod(self.action_space.shape or ()), -1)

    @denormals_flushed()
    @torch.no_grad()
    def train(self, gradient_steps: int, batch_size: int = 100) -> None:
        """Take gradient steps on the Huber loss of the temporal differences."""
        self._update_learning_rate(self.policy.optimizer)
        batches = _draw(self.replay_buffer, self._extract, gradient_steps, batch_size)
        # The target network is constant during these steps: one pass serves them all.
        next_values = self._target.forward(batches.next_observations, self._target_pass)
        next_values = self._by_part(next_values).amax(2).mean(1, keepdim=True)
        targets = batches.rewards + batches.discounts * next_values
        errors = []
        steps = zip(batches.split(batch_size), targets.split(batch_size), strict=True)
        for batch, target in steps:
            outputs = self._online.forward(batch.observations, self._learning_pass)
            values, actions = self._by_part(outputs), batch.actions[:, :, None]
            error = values.gather(2, actions).mean(1).sub_(target)
            errors.append(error)
            # The derivatives of the Huber loss, of which each part has its share.
            slopes = error.clamp(-1, 1).div_(batch_size * actions.shape[1])
            gradient = torch.zeros_like(values).scatter_(
                2, actions, slopes[:, None].expand_as(actions)
            )
            self._online.backward(gradient.view_as(outputs), self._learning_pass)
            self._adam.clip(self.max_grad_norm)
            self._adam.step()

        self._n_updates += gradient_steps
        self.logger.record("train/n_updates", self._n_updates, exclude="tensorboard")
        loss = functional.smooth_l1_loss(torch.cat(errors), torch.zeros_like(targets))
        self.logger.record("train/loss", loss.item())


class LeanSAC(_Lean, SAC):
    """SAC (Haarnoja et al. 2018) that learns as SB3's does."""

    def _set_up_passes(self) -> None:
        self._actor_adam = FlatAdam(cast(Adam, self.actor.optimizer))
        self._critic_adam = FlatAdam(cast(Adam, self.critic.optimizer))
        learned = self.ent_coef_optimizer
        self._entropy_adam = None if learned is None else FlatAdam(learned)
        self._target_values = flatten(list(self.critic_target.parameters()))
        self._extract = _extraction(self.actor)
        self._gaussian = _SquashedGaussian(self.actor)
        self._critics = [(_mlp(network), Pass()) for network in self.critic.q_networks]
        self._targets = [(_mlp(network), Pass()) for network in self.critic_target.q_networks]
        self._actor_passes, self._next_actor_passes = ((Pass(), Pass(), Pass()) for _ in range(2))

    @property
    def vectors(self) -> dict[str, Tensor]:
        """All tensors that learning modifies, by name."""
        adams = {"actor": self._actor_adam, "critic": self._critic_adam}
        if self._entropy_adam is not None:
            adams["entropy"] = self._entropy_adam
        vectors = {"target": self._target_values}
        for adam_name, adam in adams.items():
            vectors |= {f"{adam_name}_{name}": vector for name, vector in adam.vectors.items()}
        return vectors

    @denormals_flushed()
    @torch.no_grad()
    def train(self, gradient_steps: int, batch_size: int = 64) -> None:
        """Take gradient steps: entropy coefficient, critics, actor, target critics."""
        optimizers = [self.actor.optimizer, self.critic.optimizer, self.ent_coef_optimizer]
        self._update_learning_rate([each for each in optimizers if each is not None])
        logged = []
        batches = _draw(self.replay_buffer, self._extract, gradient_steps, batch_size).split(
            batch_size
        )
        for step, batch in enumerate(batches):
            noise = torch.randn_like(batch.actions)
            next_noise = torch.randn_like(batch.actions)
            next_sample = self._gaussian.sample(
                batch.next_observations, next_noise, self._next_actor_passes
            )
            sample = self._gaussian.sample(batch.observations, noise, self._actor_passes)
            ent_coef = self._entropy_step(sample.log_prob)

            next_inputs = torch.cat([batch.next_observations, next_sample.actions], 1)
            next_values = torch.minimum(
                *(target.forward(next_inputs, kept) for target, kept in self._targets)
            )
            soft_values = next_values - ent_coef * next_sample.log_prob
            targets = batch.rewards + batch.discounts * soft_values
            inputs = torch.cat([batch.observations, batch.actions], 1)
            critic_loss = self._critic_step(inputs, targets)
            actor_loss = self._actor_step(batch.observations, sample, ent_coef)
            if step % self.target_update_interval == 0:
                self._target_values.lerp_(self._critic_adam.values, self.tau)
            logged.append((ent_coef, actor_loss, critic_loss))

        self._n_updates += gradient_steps
        self.logger.record("train/n_updates", self._n_updates, exclude="tensorboard")
        names = ("ent_coef", "actor_loss", "critic_loss")
        for name, values in zip(names, zip(*logged, strict=True), strict=True):
            self.logger.record(f"train/{name}", np.mean(values))

    def _entropy_step(self, log_prob: Tensor) -> float:
        """Return the entropy coefficient; if it is learned, update it for the next step."""
        if self._entropy_adam is None:
            return self.ent_coef_tensor.item()
        assert self.log_ent_coef is not None and isinstance(self.target_entropy, float)
        ent_coef = self.log_ent_coef.exp().item()
        self._entropy_adam.gradient[0] = -(log_prob + self.target_entropy).mean()
        self._entropy_adam.step()
        return ent_coef

    def _critic_step(self, inputs: Tensor, targets: Tensor) -> float:
        """Take a gradient step on half the sum of the mean squared errors, and return that."""
        loss = 0.0
        for critic, kept in self._critics:
            errors = critic.forward(inputs, kept) - targets
            loss += 0.5 * errors.square().mean().item()
            critic.backward(errors.div_(len(errors)), kept)
        self._critic_adam.step()
        return loss

    def _actor_step(self, features: Tensor, sample: "Sample", ent_coef: float) -> float:
        """Take a gradient step on the mean of `ent_coef * log_prob - min(Q)`, and return that."""
        inputs = torch.cat([features, sample.actions], 1)
        values = torch.stack([critic.forward(inputs, kept) for critic, kept in self._critics])
        smallest, index = values.min(0)
        by_actions = torch.zeros_like(sample.actions)
        for number, (critic, kept) in enumerate(self._critics):
            by_values = (index == number) / -len(features)
            by_actions += critic.input_gradient(by_values, kept, first=features.shape[1])
        self._gaussian.backward(sample, by_actions, ent_coef / len(features))
        self._actor_adam.step()
        return (ent_coef * sample.log_prob - smallest).mean().item()


@dataclass(frozen=True)
class Sample:
    """Actions drawn from the stochastic policy, and the values that the backward pass needs."""

    actions: Tensor  # in (-1, 1), shape (n, actions)
    log_prob: Tensor  # their log-probabilities, shape (n, 1)
    slope: Tensor  # derivative of tanh at each, shape (n, actions)
    deviation: Tensor  # from the Gaussian's mean, shape (n, actions)
    is_within: Tensor  # whether the log standard deviation was not clipped, shape (n, actions)
    passes: ActorPasses


class _SquashedGaussian:
    """SAC's stochastic policy: a Gaussian whose samples are squashed by tanh."""

    def __init__(self, actor: Actor) -> None:
        self._latent = _mlp(actor.latent_pi, relu_output=True)
        self._mean = MLP([cast(nn.Linear, actor.mu)])
        self._log_std = MLP([cast(nn.Linear, actor.log_std)])

    def sample(self, features: Tensor, noise: Tensor, passes: ActorPasses) -> Sample:
        """Sample by reparametrisation, from features and standard normal noise, (n, ...) each."""
        latent_pass, mean_pass, log_std_pass = passes
        latent = self._latent.forward(features, latent_pass)
        free = self._log_std.forward(latent, log_std_pass)
        log_std = free.clamp(LOG_STD_MIN, LOG_STD_MAX)
        deviation = noise * log_std.exp()
        actions = torch.tanh(self._mean.forward(latent, mean_pass) + deviation)
        slope = 1 - actions.square()
        densities = noise.square().mul_(-0.5).sub_(log_std).sub_((slope + TANH_EPSILON).log_())
        log_prob = densities.sum(1, keepdim=True) - LOG_SQRT_2PI * noise.shape[1]
        return Sample(actions, log_prob, slope, deviation, free == log_std, passes)

    def backward(self, sample: Sample, by_actions: Tensor, by_log_prob: float) -> None:
        """Write the gradient of a loss with respect to all parameters.

        The noise is fixed, so the standard deviation affects the action and, apart from the tanh
        correction, only the normaliser of the log-probability.

        Args:
            sample: What the loss was computed from.
            by_actions: Gradient of the loss with respect to the actions, shape (n, actions).
            by_log_prob: Its derivative with respect to each log-probability.
        """
        correction = 2 * sample.actions * sample.slope / (sample.slope + TANH_EPSILON)
        by_mean = by_actions * sample.slope + by_log_prob * correction
        by_log_std = (by_mean * sample.deviation - by_log_prob) * sample.is_within
        latent_pass, mean_pass, log_std_pass = sample.passes
        by_latent = self._mean.backward(by_mean, mean_pass, to_inputs=True)
        by_latent += self._log_std.backward(by_log_std, log_std_pass, to_inputs=True)
        self._latent.backward(by_latent, latent_pass)


def _draw(
    replay_buffer: BatchedReplayBuffer, extract: Extraction, num_batches: int, batch_size: int
) -> Batches:
    """Draw batches whose observations are features (the same for all networks of a model)."""
    batches = replay_buffer.draw(num_batches, batch_size)
    return batches._replace(
        observations=extract(batches.observations),
        next_observations=extract(batches.next_observations),
    )


def _extraction(network: BaseModel) -> Extraction:
    """Return the function of a network's feature extractor, without the module's hooks."""
    return cast(BaseFeaturesExtractor, network.features_extractor).forward


def _mlp(network: nn.Module, relu_output: bool = False) -> MLP:
    layers = [layer for layer in network.children() if isinstance(layer, nn.Linear)]
    return MLP(layers, relu_output)
