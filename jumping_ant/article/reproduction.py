"""The article's own tests of trained agents, and where its printed values lie among ours.

DQN and SAC: the final model runs for 1,000 control steps, exploring as in training, and nothing
terminates or resets the episode: a robot that has fallen continues. (Stable-Baselines3's `predict`
explores unless told not to: DQN draws a random command with its final epsilon, SAC draws from its
Gaussian.) In the article MuJoCo resets a state that is not finite; here the rewards are zero from
such a state on.

PGPE: the fitness of the population, generation by generation, from the learning curve. The
article's film showed the centre in a problem whose normaliser was empty and was not updated, that
is, with raw observations; both that and the centre as trained are measured.

A printed value is a single sample. It counts as reproduced if at least eight seeds were trained and
it lies within the central 95 % of their values.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from jumping_ant.article import printed_values
from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.base.seeding import derive
from jumping_ant.experiment import curves
from jumping_ant.experiment.models import Params
from jumping_ant.policies import policy_file
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import robot
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World

AGENTS = ("dqn", "sac", "pgpe")
CENTRAL = 95.0  # [%] of our values, within which a printed one is reproduced
MIN_SEEDS = 8  # with fewer, nothing is decided

Array = NDArray[np.float64]
Act = Callable[[Array], Array]


@dataclass(frozen=True)
class Trace:
    """A printed series beside ours."""

    printed: Mapping[int, float]  # by control step or generation
    ours: Array  # at steps or generations 1, 2, ..., (num_seeds, length)

    def places(self) -> list[dict[str, Any]]:
        """Return where each printed value lies among ours, with its step or generation as `at`."""
        return [{"at": at} | place(value, self._at(at)) for at, value in self.printed.items()]

    def last(self) -> dict[str, Any]:
        """Return where the last printed value lies among ours."""
        at = max(self.printed)
        return place(self.printed[at], self._at(at))

    def _at(self, at: int) -> Array:
        return self.ours[:, at - 1]


@dataclass(frozen=True)
class Reproduction:
    """All values that are compared with the article."""

    seeds: list[int]
    totals: Mapping[str, Trace]  # running totals of the rewards in the tests of DQN and SAC
    fitness: Mapping[str, Trace]  # of PGPE's population by generation: mean, best and median
    film: Array  # return of PGPE's centre with raw observations in 1,000 steps, (num_seeds,)
    trained: Array  # the same with observations normalised as in training
    seconds: Mapping[str, list[float]]  # training time by agent and seed [s], without validation

    def summary(self) -> dict[str, Any]:
        """Return all values as JSON-compatible data; docs/article.md describes the keys."""
        printed = {
            agent: trace.last() | {"points": trace.places()} for agent, trace in self.totals.items()
        }
        steps = printed_values.PGPE_FILM_STEPS
        film = (printed_values.PGPE_FILM_FITNESS + steps) / steps * printed_values.TEST_STEPS
        printed["pgpe"] = self.fitness["fitness_mean"].last() | {
            "traces": {name: trace.places() for name, trace in self.fitness.items()},
            "film": place(round(film, 1), self.film),
            "trained_normalizer": {"ours": self.trained.tolist()} | _spread(self.trained),
        }
        return {
            "printed": printed,
            "seeds": self.seeds,
            "training": {
                "seconds": self.seconds,
                "hours_on_2_cores": sum(map(sum, self.seconds.values())) / 2 / 3600,
                "stated_hours": printed_values.STATED_HOURS,
            },
        }


def reproduce(root: Path, params: Params) -> Reproduction:
    """Run the article's tests on the trained agents of a project, which must have all `AGENTS`."""
    dqn, _, _ = (_agent(params, name) for name in AGENTS)
    world = World(robot.read(root), params.env)
    dqn_totals = _test(root, world, params, "dqn", epsilon=dqn.exploration_final_eps)
    sac_totals = _test(root, world, params, "sac")
    centers = [_final_policy(root, "pgpe", seed) for seed in params.seeds]
    returns = partial(_returns, world, params.seeds)
    return Reproduction(
        seeds=params.seeds,
        totals={
            "dqn": Trace(printed_values.DQN_TOTALS, dqn_totals),
            "sac": Trace(printed_values.SAC_TOTALS, sac_totals),
        },
        fitness=_fitness(root, params),
        film=returns([without_normalizer(center) for center in centers]),
        trained=returns(centers),
        seconds={agent: _training_seconds(root, params, agent) for agent in AGENTS},
    )


def play(
    world: World, act: Act, hold: int, seed: int, num_steps: int = printed_values.TEST_STEPS
) -> Array:
    """Run without termination or reset, and return the reward of each control step, (num_steps,).

    `act` chooses torques, shape (1, num_motors), every `hold` control steps. Rewards are zero from
    the first state on that is not finite.
    """
    envs = RobotVectorEnv(world, 1, autoreset_mode=AutoresetMode.DISABLED)
    observations, _ = envs.reset(seed=[seed])
    rewards = np.zeros(num_steps)
    for step in range(num_steps):
        if step % hold == 0:
            torques = act(observations)
        observations, reward, *_ = envs.step(torques)
        rewards[step] = reward[0]
    envs.close()
    return rewards


def without_normalizer(policy: LinearPolicy) -> LinearPolicy:
    """Return the policy without normalisation of its observations."""
    return replace(policy, mean=np.zeros_like(policy.mean), stdev=np.ones_like(policy.stdev))


def place(value: float, ours: Array) -> dict[str, Any]:
    """Return where a printed value lies among ours, (num_seeds,); docs/article.md has the keys."""
    percentile = percentile_among(value, ours)
    return {
        "value": value,
        "ours": ours.tolist(),
        "percentile": percentile,
        "reproduced": _is_central(percentile) if len(ours) >= MIN_SEEDS else None,
    } | _spread(ours)


def percentile_among(value: float, ours: Array) -> float:
    """Return the share of values below a given one [%]; equal values count half."""
    return float(100.0 * (np.mean(ours < value) + np.mean(ours == value) / 2))


def _is_central(percentile: float) -> bool:
    edge = (100.0 - CENTRAL) / 2
    return edge < percentile < 100.0 - edge


def _spread(ours: Array) -> dict[str, float]:
    """Return the median, and the smallest and largest of the values in the central 95 %."""
    central = [float(value) for value in ours if _is_central(percentile_among(value, ours))]
    return {"median": float(np.median(ours)), "low": min(central), "high": max(central)}


def _agent(params: Params, name: str) -> Any:
    """Return the block of one of the article's agents."""
    agent = params.agent(name)
    if agent.algorithm != name:
        raise InputError(f"agents.{name}.algorithm: given {agent.algorithm}, allowed: {name}")
    return agent


def _test(root: Path, world: World, params: Params, agent: str, **exploration: float) -> Array:
    """Return running totals, (num_seeds, TEST_STEPS); `exploration` goes to `explore`."""
    rewards = []
    for seed in params.seeds:
        policy = _final_policy(root, agent, seed)
        generators = [np.random.default_rng(derive(seed, "test", 1))]
        act = partial(policy.explore, generators=generators, **exploration)
        rewards.append(play(world, act, policy.actions.hold, derive(seed, "test")))
    return np.cumsum(rewards, axis=1)


def _returns(world: World, seeds: Sequence[int], centers: Sequence[Policy]) -> Array:
    """Return each policy's return over as many steps as the tests have, shape (num_seeds,)."""
    return np.array(
        [
            play(world, center.act, center.actions.hold, derive(seed, "test")).sum()
            for seed, center in zip(seeds, centers, strict=True)
        ]
    )


def _final_policy(root: Path, agent: str, seed: int) -> Any:
    paths = Paths(root).agent(agent).seed(seed)
    return policy_file.load(paths.final_policy, paths.owner)


def _fitness(root: Path, params: Params) -> dict[str, Trace]:
    """Return PGPE's fitness, with the same number of generations for every seed."""
    names = list(printed_values.PGPE_TRACES)
    needed = max(max(printed) for printed in printed_values.PGPE_TRACES.values())
    rows: dict[str, list[Array]] = {name: [] for name in names}
    for seed in params.seeds:
        curve = curves.read(root, params, "pgpe", seed)
        is_generation = ~np.isnan(curve["updates"])  # the other rows are from validation
        path = Paths(root).agent("pgpe").seed(seed).curve
        if (count := int(is_generation.sum())) < needed:
            raise InputError(f"{path}: given {count} generations, allowed: {needed} or more")
        for name in names:
            own = curve.get(name, np.full(len(is_generation), np.nan))[is_generation][:needed]
            if np.isnan(own).any():
                raise InputError(f"{path}: given generations without {name}, allowed: all with it")
            rows[name].append(own)
    return {name: Trace(printed_values.PGPE_TRACES[name], np.array(rows[name])) for name in names}


def _training_seconds(root: Path, params: Params, agent: str) -> list[float]:
    timed = curves.read_timed(root, params, agent)
    return [float(curve["seconds"][-1]) for curve in timed.values()]
