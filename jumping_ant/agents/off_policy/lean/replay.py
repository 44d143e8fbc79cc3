"""A replay buffer that draws several batches at once."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.buffers import NStepReplayBuffer
from torch import Tensor


class Batches(NamedTuple):
    """Several batches of n-step transitions, one after the other, of n rows in total."""

    observations: Tensor  # (n, observation)
    actions: Tensor  # (n, action)
    rewards: Tensor  # discounted sum of the steps' rewards, (n, 1)
    next_observations: Tensor  # after the last of the steps, (n, observation)
    discounts: Tensor  # of the next observation's value, zero where the episode ended, (n, 1)

    def split(self, batch_size: int) -> Iterator["Batches"]:
        """Yield the batches one by one; nothing is copied."""
        columns = (column.view(-1, batch_size, column.shape[1]).unbind() for column in self)
        return map(Batches._make, zip(*columns, strict=True))


class BatchedReplayBuffer(NStepReplayBuffer):
    """Stable-Baselines3's n-step replay buffer, drawing several batches in one pass.

    With the same random numbers it draws the same transitions as that many calls of `sample`, of
    this class or, for one step, of SB3's `ReplayBuffer`.
    """

    def draw(self, num_batches: int, batch_size: int) -> Batches:
        """Draw batches uniformly, with replacement: num_batches * batch_size rows in total."""
        starts = np.concatenate([self._draw_indices(batch_size) for _ in range(num_batches)])
        steps = starts[:, None] + np.arange(self.n_steps) * self.n_envs
        steps %= self.rewards.size
        lengths = self._lengths(steps)
        ends = steps[np.arange(len(steps)), lengths - 1]

        powers = self.gamma ** np.arange(self.n_steps, dtype=np.float32)
        counts = np.arange(self.n_steps) < lengths[:, None]
        rewards = (self.rewards.take(steps) * powers * counts).sum(1, keepdims=True)
        terminal = self.dones.take(ends) * (1 - self.timeouts.take(ends))
        discounts = (1 - terminal) * self.gamma ** lengths.astype(np.float32)
        return Batches(
            observations=_rows(self.observations, starts),
            actions=_rows(self.actions, starts),
            rewards=torch.from_numpy(rewards),
            next_observations=_rows(self.next_observations, ends),
            discounts=torch.from_numpy(discounts[:, None]),
        )

    def _draw_indices(self, batch_size: int) -> NDArray[np.int64]:
        """Draw transitions as SB3 does; return their indices among all environments' rows."""
        rows = np.random.randint(0, self.buffer_size if self.full else self.pos, size=batch_size)
        envs = np.random.randint(0, self.n_envs, size=batch_size)
        return rows * self.n_envs + envs

    def _lengths(self, steps: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return how many steps count: up to an episode's end, or to the newest transition."""
        newest = (self.pos - 1) % self.buffer_size
        is_end = (self.dones.take(steps) > 0) | (self.timeouts.take(steps) > 0)
        is_end |= steps // self.n_envs == newest
        is_end[:, -1] = True
        return is_end.argmax(1) + 1


def _rows(array: NDArray[np.float32], indices: NDArray[np.int64]) -> Tensor:
    """Return rows of an array of shape (steps, envs, values), shape (len(indices), values)."""
    return torch.from_numpy(array.reshape(-1, array.shape[-1]).take(indices, axis=0))
