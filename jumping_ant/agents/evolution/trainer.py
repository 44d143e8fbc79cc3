"""Evolution of a linear policy or of oscillators, mostly on EvoTorch."""

from collections.abc import Iterator

import numpy as np

from jumping_ant.agents.catalogue import row
from jumping_ant.agents.events import Checkpoint, Event, Finished, Progress, Snapshot
from jumping_ant.agents.evolution.algorithms import EvolutionParams
from jumping_ant.agents.evolution.problem import JumpProblem, OscillatorProblem
from jumping_ant.agents.evolution.searchers import Searcher, make_searcher
from jumping_ant.agents.job import Job
from jumping_ant.base.archive import pack_state, unpack_state

PROBLEMS = {"linear": JumpProblem, "oscillator": OscillatorProblem}  # by the kind of policy


def train(job: Job[EvolutionParams]) -> Iterator[Event]:
    """Evolve a policy; each row of the curve is a generation, each snapshot its centre."""
    agent = job.agent
    problem = PROBLEMS[row(agent).policy_kind](job)
    searcher = make_searcher(problem, agent)
    if job.checkpoint is not None:
        state = unpack_state(job.checkpoint)
        searcher.load_state(state["searcher"])
        problem.load_state(state["problem"])
    while searcher.generation < agent.generations:
        searcher.step()
        generation = searcher.generation
        yield Progress(
            env_steps=problem.env_steps,
            updates=generation,
            episodes=generation * agent.population_size,
            return_mean=float(problem.returns.mean()),
            return_std=float(problem.returns.std()),
            extra={
                "return_best": float(problem.returns.max()),
                "fitness_mean": float(problem.fitness.mean()),
                "fitness_median": float(np.median(problem.fitness)),
                "fitness_best": float(problem.fitness.max()),
                "center_norm": float(searcher.center.norm()),
                "stdev_mean": float(searcher.spread.mean()),
            },
        )
        if generation * job.evaluations % agent.generations < job.evaluations:
            yield Snapshot(problem.env_steps, _policy_bytes(searcher, problem))
        if job.is_checkpoint_due():
            state = {"searcher": searcher.save_state(), "problem": problem.save_state()}
            yield Checkpoint(problem.env_steps, pack_state(state))
    yield Finished(problem.env_steps, _policy_bytes(searcher, problem))


def _policy_bytes(searcher: Searcher, problem: JumpProblem) -> bytes:
    """Return the policy at the distribution's centre, as a policy file."""
    return problem.policy(searcher.center, searcher.spread).to_bytes()
