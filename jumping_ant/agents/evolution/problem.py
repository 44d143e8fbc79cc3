"""The EvoTorch problems of finding a linear policy that jumps, or oscillators that do.

A generation's policies run side by side, for one short episode each, in one or more shares.
"""

import logging
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import torch
from gymnasium.utils.seeding import np_random
from numpy.typing import NDArray

from jumping_ant.actions import ActionSet
from jumping_ant.agents.evolution.algorithms import EvolutionParams
from jumping_ant.agents.evolution.library import Normalizer, Problem, SolutionBatch, plain
from jumping_ant.agents.evolution.shares import Act, Array, Play, Share, joined
from jumping_ant.agents.job import Job
from jumping_ant.base.seeding import derive, derive_all
from jumping_ant.compute.parts import Parts, Rows, Threads
from jumping_ant.policies.blind import OscillatorPolicy, Oscillators
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.sim.task import Task

Evolved = LinearPolicy | OscillatorPolicy
Network = tuple[torch.Tensor, torch.Tensor]  # weight (outputs, observations), bias (outputs,)
INITIAL_BOUNDS = (-1e-5, 1e-5)  # of the initial centre, as in EvoTorch's GymNE


class JumpProblem(Problem):
    """The EvoTorch problem of finding a linear policy that jumps.

    A solution is the flat weight (num_outputs, num_observations) followed by the bias
    (num_outputs,); the outputs are torques, or preferences for commands. Its fitness is the return
    of one episode, less `decrease_rewards_by` per control step survived. The normaliser is fixed
    within a generation, so that all of its policies are evaluated alike, and is then updated with
    their observations.
    """

    def __init__(self, job: Job[EvolutionParams]) -> None:
        logging.getLogger("evotorch").setLevel(logging.WARNING)  # it logs every problem
        agent, anatomy = job.agent, job.world.anatomy
        self.actions = ActionSet.of(agent.actions, job.world.env.commands)
        self._shape = (self.actions.num_outputs(anatomy.num_motors), anatomy.num_observations)
        super().__init__(
            "max",
            solution_length=self._solution_length(),
            dtype=torch.float32,
            initial_bounds=INITIAL_BOUNDS,
            seed=derive(job.seed, "search", bits=32),
        )
        self.agent = agent
        self.normalizer = Normalizer(shape=anatomy.num_observations, dtype=torch.float32)
        self.env_steps = 0
        self.returns: NDArray[np.float64] = np.zeros(agent.population_size)
        self.fitness: NDArray[np.float64] = np.zeros(agent.population_size)
        starts = derive_all(job.seed, "starts", agent.population_size)
        self._generators: Sequence[np.random.Generator] = [np_random(seed)[0] for seed in starts]
        task = Task(job.world)
        for generator in self._generators:
            task.start_state(generator)  # Gymnasium's environments draw one when they are seeded
        make = partial(
            Share,
            job.world,
            self.actions,
            agent.episode_steps,
            keeps_observations=agent.observation_normalization,
        )
        spread = job.spread or partial(Threads, num_threads=job.num_threads)
        self._shares: Parts[Share] = spread(make, agent.population_size)

    def _solution_length(self) -> int:
        num_outputs, num_observations = self._shape
        return num_outputs * (num_observations + 1)

    def policy(self, center: torch.Tensor, spread: torch.Tensor) -> Evolved:
        """Return the policy at a centre, (solution_length,), with the current normaliser."""
        weight, bias = _unflatten(center, self._shape)
        mean, stdev = self._moments()
        weight_spread, bias_spread = _unflatten(spread, self._shape)
        return LinearPolicy(
            weight.numpy(),
            bias.numpy(),
            mean.numpy(),
            stdev.numpy(),
            weight_spread.numpy(),
            bias_spread.numpy(),
            self.actions,
        )

    def save_state(self) -> dict[str, Any]:
        """Return the state that later generations depend on: arrays and JSON-compatible values."""
        return {
            "env_steps": self.env_steps,
            "generator": self.generator.get_state().numpy(),
            "envs": [generator.bit_generator.state for generator in self._generators],
            **self.normalizer.save_state(),
        }

    def load_state(self, state: dict[str, Any]) -> None:
        """Restore a state from `save_state`."""
        self.env_steps = state["env_steps"]
        self.generator.set_state(torch.from_numpy(state["generator"]))
        for generator, own in zip(self._generators, state["envs"], strict=True):
            generator.bit_generator.state = own
        self.normalizer.load_state(state)

    def _evaluate_batch(self, batch: SolutionBatch) -> None:
        solutions = plain(batch.values)

        def play(rows: Rows) -> Play:
            return Play(self._start(solutions[rows]), [self._generators[row] for row in rows])

        episodes = joined(self._shares.map(Share.play, play))
        self.returns, self._generators = episodes.returns, episodes.generators
        if episodes.seen is not None:
            self.normalizer.update(torch.from_numpy(episodes.seen))
        lengths = np.minimum(
            episodes.alive[1:].sum(0) * self.actions.hold, self.agent.episode_steps
        )
        self.env_steps += int(lengths.sum())
        self.fitness = self.returns - self.agent.decrease_rewards_by * lengths
        batch.set_evals(torch.as_tensor(self.fitness, dtype=torch.float32))

    def _start(self, solutions: torch.Tensor) -> Callable[[], Act]:
        """Return what begins an episode of solutions' policies."""
        moments = (moment.numpy() for moment in self._moments())
        return partial(_networks, self._shape, solutions.numpy(), *moments)

    def _moments(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the normaliser's mean and standard deviation; 0 and 1 before its first update."""
        if self.normalizer.count == 0:
            return torch.zeros(self._shape[1]), torch.ones(self._shape[1])
        return self.normalizer.mean, self.normalizer.stdev


class OscillatorProblem(JumpProblem):
    """The EvoTorch problem of finding oscillators that jump (see `Oscillators`).

    A solution is the amplitudes, phases [rad] and offsets of all outputs, and the logarithms to the
    base 2 of the two frequencies [Hz]. Its fitness is that of `JumpProblem`.
    """

    def __init__(self, job: Job[EvolutionParams]) -> None:
        super().__init__(job)
        self._step_seconds = job.world.dt * self.actions.hold

    def _solution_length(self) -> int:
        return 3 * self._shape[0] + 2

    def policy(self, center: torch.Tensor, spread: torch.Tensor) -> Evolved:
        """Return the policy at a centre, (solution_length,)."""
        return OscillatorPolicy(self._oscillators(center), self.actions)

    def _start(self, solutions: torch.Tensor) -> Callable[[], Act]:
        return partial(_rhythms, self._oscillators(solutions))

    def _oscillators(self, solutions: torch.Tensor) -> Oscillators:
        """Return the oscillators of a solution, or of several, a row each."""
        numbers = solutions.numpy().astype(np.float64)
        amplitudes, phases, offsets = np.split(numbers[..., :-2], 3, axis=-1)
        speeds = 2 * np.pi * self._step_seconds * np.exp2(numbers[..., -2:])
        return Oscillators(amplitudes, phases, offsets, speeds)


def _unflatten(solution: torch.Tensor, shape: tuple[int, int]) -> Network:
    """Return weight, of a shape (num_outputs, num_observations), and bias of a flat solution."""
    num_outputs, num_observations = shape
    weight, bias = solution.split([num_outputs * num_observations, num_outputs])
    return weight.reshape(shape), bias


def _networks(shape: tuple[int, int], solutions: Array, mean: Array, stdev: Array) -> Act:
    """Return the outputs of linear policies, flat in a row each, for normalised observations."""
    networks = [_unflatten(solution, shape) for solution in torch.tensor(solutions)]
    outputs = torch.empty(len(networks), shape[0])
    center, scale = torch.tensor(mean), torch.tensor(stdev)

    def act(observations: Array) -> Array:
        normalized = (torch.from_numpy(observations.astype(np.float32)) - center) / scale
        # Row by row, as GymNE does: a single product of all rows would round differently.
        for row, (weight, bias), out in zip(normalized, networks, outputs, strict=True):
            torch.addmv(bias, weight, row, out=out)
        return outputs.numpy()

    return act


def _rhythms(oscillators: Oscillators) -> Act:
    """Return the outputs of oscillators from their start on, whatever the observations."""
    angles = oscillators.phases

    def act(observations: Array) -> Array:
        nonlocal angles
        outputs, angles = oscillators.outputs(angles)
        return outputs

    return act
