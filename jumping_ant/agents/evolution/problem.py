"""The EvoTorch problems of finding a linear policy that jumps, or oscillators that do.

A generation's policies play side by side, for one short episode each. Each thread steps a batch of
its own from start to end: none waits for another.
"""

import logging
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import torch
from evotorch import Problem, SolutionBatch
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from jumping_ant.agents.evolution.algorithms import EvolutionParams
from jumping_ant.agents.evolution.library import Normalizer, plain
from jumping_ant.agents.job import Job
from jumping_ant.base.seeding import derive, derive_all
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.blind import OscillatorPolicy, Oscillators
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.sim import rollout
from jumping_ant.sim.vector import RobotVectorEnv

Array = NDArray[Any]
Act = Callable[[Array], Array]  # policies' outputs for their observations, a row for each
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
        self._step_seconds = job.world.dt * self.actions.hold  # of a decision
        self.normalizer = Normalizer(shape=anatomy.num_observations, dtype=torch.float32)
        self.env_steps = 0
        size = agent.population_size
        self.returns, self.fitness = np.zeros(size), np.zeros(size)
        count = min(job.num_threads, size)
        self._rows = np.array_split(np.arange(size), count)  # of the policies, by thread
        self._envs = [
            RobotVectorEnv(
                job.world,
                len(rows),
                autoreset_mode=AutoresetMode.DISABLED,
                actions=self.actions,
                episode_steps=np.full(len(rows), agent.episode_steps),
            )
            for rows in self._rows
        ]
        starts = derive_all(job.seed, "starts", size)
        for rows, envs in zip(self._rows, self._envs, strict=True):
            envs.reset(seed=[starts[row] for row in rows])
        self._threads = ThreadPoolExecutor(count)

    def _solution_length(self) -> int:
        num_outputs, num_observations = self._shape
        return num_outputs * (num_observations + 1)

    def policy(self, center: torch.Tensor, spread: torch.Tensor) -> LinearPolicy | OscillatorPolicy:
        """Return the policy at a centre, (solution_length,), with the current normaliser."""
        parts = (*self._unflatten(center), *self._moments(), *self._unflatten(spread))
        arrays = zip(LinearPolicy.ARRAYS, (part.numpy() for part in parts), strict=True)
        return LinearPolicy(**dict(arrays), actions=self.actions)

    def save_state(self) -> dict[str, Any]:
        """Return the state that later generations depend on: arrays and JSON-compatible values."""
        return {
            "env_steps": self.env_steps,
            "generator": self.generator.get_state().numpy(),
            "envs": [generator.bit_generator.state for generator in self._generators()],
            **self.normalizer.save_state(),
        }

    def load_state(self, state: dict[str, Any]) -> None:
        """Restore a state from `save_state`."""
        self.env_steps = state["env_steps"]
        self.generator.set_state(torch.from_numpy(state["generator"]))
        for generator, saved in zip(self._generators(), state["envs"], strict=True):
            generator.bit_generator.state = saved
        self.normalizer.load_state(state)

    def _evaluate_batch(self, batch: SolutionBatch) -> None:
        solutions, most = plain(batch.values), self.agent.episode_steps
        shape = (1 - (-most // self.actions.hold), len(solutions))  # the start, and each decision
        seen = np.zeros((*shape, self._shape[1]), np.float32)
        alive, self.returns = np.zeros(shape, np.bool_), np.zeros(len(solutions))
        lengths = np.zeros(len(solutions), np.int64)  # of the episodes [control steps]

        def play(rows: Array, envs: RobotVectorEnv) -> None:
            outputs = self._start(solutions[rows])
            start, _ = envs.reset()
            seen[0, rows], alive[0, rows] = start, True
            steps = rollout.steps(envs, start, lambda each: self.actions.choices(outputs(each)))
            for number, step in enumerate(steps, start=1):
                seen[number, rows], alive[number, rows] = step.next_observations, step.alive
                self.returns[rows] += step.rewards
            lengths[rows] = envs.num_steps

        list(self._threads.map(play, self._rows, self._envs))  # raises what they raise
        if self.agent.observation_normalization:
            self.normalizer.update(torch.from_numpy(seen[alive]))
        self.env_steps += int(lengths.sum())
        self.fitness = self.returns - self.agent.decrease_rewards_by * lengths
        batch.set_evals(torch.as_tensor(self.fitness, dtype=torch.float32))

    def _generators(self) -> list[np.random.Generator]:
        """Return the generator of each policy's start states."""
        return [generator for envs in self._envs for generator in envs.generators]

    def _start(self, solutions: torch.Tensor) -> Act:
        """Begin an episode of solutions' policies, a row each."""
        networks = [self._unflatten(solution) for solution in solutions]
        outputs = torch.empty(len(networks), self._shape[0])
        mean, stdev = self._moments()

        def act(observations: Array) -> Array:
            normalized = (torch.from_numpy(observations.astype(np.float32)) - mean) / stdev
            # Row by row, as GymNE does: a single product of all rows would round differently.
            for row, (weight, bias), out in zip(normalized, networks, outputs, strict=True):
                torch.addmv(bias, weight, row, out=out)
            return outputs.numpy()

        return act

    def _unflatten(self, solution: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return a flat solution's weight, (outputs, observations), and bias, (outputs,)."""
        num_outputs, num_observations = self._shape
        weight, bias = solution.split([num_outputs * num_observations, num_outputs])
        return weight.reshape(self._shape), bias

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

    def _solution_length(self) -> int:
        return 3 * self._shape[0] + 2

    def policy(self, center: torch.Tensor, spread: torch.Tensor) -> LinearPolicy | OscillatorPolicy:
        """Return the policy at a centre, (solution_length,)."""
        return OscillatorPolicy(self._oscillators(center), self.actions)

    def _start(self, solutions: torch.Tensor) -> Act:
        oscillators = self._oscillators(solutions)
        angles = oscillators.phases

        def act(observations: Array) -> Array:
            nonlocal angles
            outputs, angles = oscillators.outputs(angles)
            return outputs

        return act

    def _oscillators(self, solutions: torch.Tensor) -> Oscillators:
        """Return the oscillators of a solution, or of several, a row each."""
        numbers = solutions.numpy().astype(np.float64)
        amplitudes, phases, offsets = np.split(numbers[..., :-2], 3, axis=-1)
        speeds = 2 * np.pi * self._step_seconds * np.exp2(numbers[..., -2:])
        return Oscillators(amplitudes, phases, offsets, speeds)
