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

    Episodes of the same policy, start and condition run once. On a cluster, each seed's are a job.

    Args:
        world: The robot and the task.
        agent: The agent's name, for the display.
        kind: What the episodes are.
        plays: The episodes of each seed.
        measure: Measures an episode; on a cluster it must be picklable.
        workers: How many workers to use; 0 requests one for each seed.
    """
    compute = partial(_play, world, agent, kind, measure)
    return [*chain(*jobs.by_seed(compute, plays, workers, agent))]


def perturbed_returns(
    world: World, params: Params, agent: str, policies: Mapping[int, Policy]
) -> dict[Case, float]:
    """Return the return of each perturbed episode of an agent, of which each seed has a policy."""
    short = {"max_episode_steps": params.robustness.episode_steps}
    cases = sorted(perturbed.cases(params, agent), key=lambda case: params.seeds.index(case.seed))
    plays: dict[int, list[Play]] = {seed: [] for seed in policies}
    for condition, seed, start in cases:
        plays[seed].append(Play(policies[seed], start, condition))
    world, workers = World(world.xml, world.env.model_copy(update=short)), params.compute.workers
    returns = play(world, agent, "perturbed", plays, Episode.total, workers)
    return dict(zip(cases, returns, strict=True))


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
