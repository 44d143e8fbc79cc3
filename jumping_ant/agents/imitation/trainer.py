"""Imitation of a demonstrated policy: a network is fitted to its torques."""

import io
from collections.abc import Iterator
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.td3.policies import Actor
from torch.nn import functional

from jumping_ant.agents.catalogue import row
from jumping_ant.agents.events import Checkpoint, Event, Finished, Progress, Snapshot
from jumping_ant.agents.imitation.algorithms import DAggerParams, ImitationParams
from jumping_ant.agents.imitation.demonstrations import Demonstrations, Labelled, concatenated, play
from jumping_ant.agents.job import Job
from jumping_ant.agents.sb3.model import ScaledObservations
from jumping_ant.agents.sb3.state import moments
from jumping_ant.base.archive import pack, pack_state, unpack_state
from jumping_ant.base.errors import InputError
from jumping_ant.base.seeding import derive
from jumping_ant.policies import policy_file
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.policy import Interface, header_entries


def train(job: Job[ImitationParams]) -> Iterator[Event]:
    """Fit a policy to demonstrations; a row of the curve is a round, with its mean loss."""
    agent, imitator = job.agent, _Imitator(job)
    if job.checkpoint is not None:
        imitator.load_state(unpack_state(job.checkpoint))
    while imitator.round < agent.rounds:
        returns = imitator.grow()
        loss = imitator.fit()
        yield Progress(
            env_steps=imitator.env_steps,
            updates=imitator.round * agent.updates_per_round,
            episodes=imitator.episodes,
            return_mean=float(returns.mean()) if len(returns) else float("nan"),
            return_std=float(returns.std()) if len(returns) else float("nan"),
            extra={"loss": loss},
        )
        if imitator.round * job.evaluations % agent.rounds < job.evaluations:
            yield Snapshot(imitator.env_steps, imitator.policy_bytes())
        if job.is_checkpoint_due():
            yield Checkpoint(imitator.env_steps, pack_state(imitator.save_state()))
    yield Finished(imitator.env_steps, imitator.policy_bytes())


class _Imitator:
    """An actor, the data that it is fitted to, and where these come from."""

    def __init__(self, job: Job[ImitationParams]) -> None:
        if job.demonstrations is None:
            raise InputError("demonstrations: given none, allowed: those of a trained agent")
        self.round = self.env_steps = self.episodes = 0  # rounds done; size of the data
        self._job, self._agent = job, job.agent
        self._actions = ActionSet.of(job.agent.actions, job.world.env.commands)
        self._anatomy = job.world.anatomy
        demonstrations = Demonstrations.from_bytes(job.demonstrations)
        self._expert = policy_file.parse(demonstrations.expert)
        self._generator = np.random.default_rng(derive(job.seed, "replay"))
        episodes = demonstrations.labelled.episodes()
        order = self._generator.permutation(len(episodes))
        self._demonstrated = concatenated([episodes[index] for index in order])
        self._data = self._demonstrated[:0]
        torch.manual_seed(derive(job.seed, "learner", bits=32))
        anatomy, agent = self._anatomy, job.agent
        seen = spaces.Box(-np.inf, np.inf, (anatomy.num_observations,), np.float32)
        chosen = spaces.Box(-1.0, 1.0, (anatomy.num_motors,), np.float32)
        features = ScaledObservations(seen, agent.velocity_scale, anatomy.num_observed_positions)
        self._actor = Actor(seen, chosen, agent.net_arch, features, features.features_dim)
        self._optimizer = torch.optim.Adam(self._actor.mu.parameters(), lr=agent.learning_rate)

    def grow(self) -> NDArray[np.float64]:
        """Begin a round: add its share of the data, and return the returns of their episodes."""
        self.round += 1
        agent, hold = self._agent, self._actions.hold
        size = -(-agent.total_steps * self.round // (agent.rounds * hold))  # in decisions
        if isinstance(agent, DAggerParams) and self.round > 1:
            more = self._play(size - len(self._data), agent)
        else:
            more = self._demonstrated[len(self._data) : size]
        self._data = concatenated([self._data, more])
        if len(self._data) < size:
            raise InputError(
                f"demonstrations: given {len(self._data) * hold} control steps, allowed: "
                f"{agent.total_steps} or more, as total_steps says"
            )
        self.env_steps = size * hold
        returns = more.returns[~np.isnan(more.returns)]
        self.episodes += len(returns)
        return returns

    def fit(self) -> float:
        """Fit the actor to all data, and return the mean of its losses."""
        observations = torch.from_numpy(self._data.observations)
        choices = torch.from_numpy(self._data.torques / np.float32(self._actions.amplitude))
        total = 0.0
        for _ in range(self._agent.updates_per_round):
            rows = self._generator.integers(len(self._data), size=self._agent.batch_size)
            loss = functional.mse_loss(self._actor(observations[rows]), choices[rows])
            self._optimizer.zero_grad()
            loss.backward()
            self._optimizer.step()
            total += loss.item()
        return total / self._agent.updates_per_round

    def policy_bytes(self) -> bytes:
        """Return the actor as a policy file."""
        anatomy, weights = self._anatomy, io.BytesIO()
        torch.save({f"actor.{name}": v for name, v in self._actor.state_dict().items()}, weights)
        interface = Interface(self._actions, anatomy.num_observations, anatomy.num_motors)
        header = header_entries(row(self._agent).policy_kind, interface)
        return pack(header | {"policy.pth": weights.getvalue()})

    def save_state(self) -> dict[str, Any]:
        """Return the state that later rounds depend on: arrays and JSON-compatible values."""
        return {
            "counters": [self.round, self.env_steps, self.episodes],
            "generator": self._generator.bit_generator.state,
            "data": vars(self._data),
            "learner": {name: vector.numpy() for name, vector in self._vectors().items()},
        }

    def load_state(self, state: dict[str, Any]) -> None:
        """Restore a state from `save_state`."""
        self.round, self.env_steps, self.episodes = state["counters"]
        self._generator.bit_generator.state = state["generator"]
        self._data = Labelled(**state["data"])
        for name, vector in self._vectors().items():
            vector.copy_(torch.from_numpy(state["learner"][name]))

    def _play(self, decisions: int, agent: DAggerParams) -> Labelled:
        """Let the actor play, with the expert's labels, for a number of decisions."""
        actor = policy_file.parse(self.policy_bytes())
        played, number = self._data[:0], 0
        steps = -(-agent.episode_steps // self._actions.hold)
        while (lacking := decisions - len(played)) > 0:
            count = -(-lacking // steps)
            # A round has no more episodes than decisions.
            first = self.round * agent.total_steps + number
            seeds = [derive(self._job.seed, "starts", first + index) for index in range(count)]
            more = play(
                self._job.world,
                actor,
                self._expert,
                seeds,
                agent.episode_steps,
                agent.tumbled_starts,
                self._job.num_threads,
            )
            played, number = concatenated([played, more]), number + count
        return played[:decisions]

    def _vectors(self) -> dict[str, torch.Tensor]:
        """Return all tensors that learning modifies, by name; they are not copied."""
        parameters = {f"actor.{key}": value for key, value in self._actor.state_dict().items()}
        return parameters | moments(self._optimizer)
