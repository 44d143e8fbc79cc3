"""Episodes of an agent's policies, under perturbations or none, and what is measured of them."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import chain
from typing import TypeVar

from jumping_ant.base import progress
from jumping_ant.compute import jobs
from jumping_ant.evaluation import perturbed
from jumping_ant.evaluation.perturbed import Case
from jumping_ant.params.model import Params
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import rollout
from jumping_ant.sim.rollout import Episode, Play
from jumping_ant.sim.world import World

Measured = TypeVar("Measured")


def play(
    world: World,
    agent: str,
    kind: str,
    plays: Mapping[int, Sequence[Play]],
    measure: Callable[[Episode], Measured],
    workers: int,
) -> list[Measured]:
    """Play episodes of each seed, and return what is measured of each, in their order.

    Episodes of the same policy, start and condition run once. On a cluster, each seed's are a job,
    and `measure` is pickled. With 0 workers, there is one for each seed.
    """
    compute = partial(_play, world, agent, kind, measure)
    return [*chain(*jobs.by_seed(compute, plays, workers, agent))]


def perturbed_returns(
    world: World, params: Params, agent: str, policies: Mapping[int, Policy]
) -> dict[Case, float]:
    """Return the return of each perturbed episode of an agent, in the order of `cases`."""
    short = {"max_episode_steps": params.robustness.episode_steps}
    cases: dict[int, list[Case]] = {seed: [] for seed in policies}
    for case in perturbed.cases(params, agent):
        cases[case.seed].append(case)
    plays = {
        seed: [Play(policies[seed], case.start, case.condition) for case in own]
        for seed, own in cases.items()
    }
    world, workers = World(world.xml, world.env.model_copy(update=short)), params.compute.workers
    returns = play(world, agent, "perturbed", plays, Episode.total, workers)
    found = dict(zip(chain(*cases.values()), returns, strict=True))
    return {case: found[case] for case in perturbed.cases(params, agent)}


def _play(
    world: World,
    agent: str,
    kind: str,
    measure: Callable[[Episode], Measured],
    plays: Mapping[int, Sequence[Play]],
    num_threads: int,
) -> list[Measured]:
    every = list(chain(*plays.values()))
    keys = [(id(one.policy), one.start, one.condition) for one in every]
    different = dict(zip(keys, every, strict=True))
    episodes = rollout.play(world, list(different.values()), num_threads)
    parts = ([measure(episode)] for episode in episodes)
    shown = chain.from_iterable(progress.shown(parts, len(different), agent, f"{kind} episodes"))
    measured = dict(zip(different, shown, strict=True))
    return [measured[key] for key in keys]
