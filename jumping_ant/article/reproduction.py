"""The article's own tests of trained agents, and where its printed values lie among ours.

DQN and SAC: the final model runs for 1,000 control steps, exploring as in training, and nothing
terminates or resets the episode: a robot that has fallen continues. (Stable-Baselines3's `predict`
explores unless told not to: DQN draws a random command with its final epsilon, SAC draws from its
Gaussian.) In the article MuJoCo resets a state that is not finite; here the rewards are zero from
such a state on. The article tested once; here every seed's policy is tested often.

PGPE: the fitness of the population, generation by generation, from the learning curve, which is a
single number a seed. The article's film showed the centre in a problem whose normaliser was empty
and was not updated, that is, with raw observations; both that and the centre as trained are
measured.

A printed value is one test of one policy. It is not reproduced if it lies too far out to be a test
of another policy of ours, and reproduced if there is no doubt that it does not (see `judge`).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from scipy import stats

from jumping_ant.article import printed_values, tail
from jumping_ant.base import machine
from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.base.seeding import derive
from jumping_ant.params.model import Params
from jumping_ant.policies import trained_policy
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.policies.networks import GreedyCommands
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import robot
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World
from jumping_ant.training import curves

AGENTS = ("dqn", "sac", "pgpe")
CENTRAL = 95.0  # [%] of our values, which `low` and `high` enclose
NUM_TESTS = 50  # of each seed's policy
CONTROL = 4  # the command that is tested for comparison: it lifts all four feet
# Levels of two-sided p values. A value too far out is not reproduced: the level of a test, for the
# four values of the table in docs/article.md together. Reproduced is what surely is further in.
TOO_FAR_OUT = 0.05 / 4
FAR_IN = 0.05

Array = NDArray[np.float64]
Act = Callable[[Array], Array]


@dataclass(frozen=True)
class Trace:
    """A printed series beside ours."""

    printed: Mapping[int, float]  # by control step or generation
    ours: Array  # at steps or generations 1, 2, ..., (num_seeds, num_tests, length)

    def places(self) -> list[dict[str, Any]]:
        """Return where each printed value lies among ours, with its step or generation as `at`."""
        return [
            {"at": at} | place(value, self.ours[:, :, at - 1]) for at, value in self.printed.items()
        ]

    def last(self) -> dict[str, Any]:
        """Return where the last printed value lies among ours."""
        at = max(self.printed)
        return place(self.printed[at], self.ours[:, :, at - 1])


@dataclass(frozen=True)
class Reproduction:
    """All values of some agents that are compared with the article."""

    seeds: list[int]
    seconds: Mapping[str, list[float]]  # training time by agent and seed [s], without validation
    totals: Mapping[str, Trace]  # running totals of the rewards in the tests of DQN and SAC
    # How often a command that is always the same reaches DQN's value.
    control: dict[str, Any] = field(default_factory=dict)
    # Of PGPE: its population by generation (mean, best and median); returns of its centre in 1,000
    # steps, with raw observations, (num_seeds, num_tests), and normalised as in training.
    fitness: Mapping[str, Trace] = field(default_factory=dict)
    film: Array = field(default_factory=lambda: np.zeros((0, 0)))
    trained: Array = field(default_factory=lambda: np.zeros(0))

    def summary(self) -> dict[str, Any]:
        """Return all values as JSON-compatible data; docs/article.md describes the keys."""
        printed = {
            agent: trace.last() | {"points": trace.places()} for agent, trace in self.totals.items()
        }
        if "dqn" in printed:
            printed["dqn"]["control"] = self.control
        if self.fitness:
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
                "stated_hours": {name: printed_values.STATED_HOURS[name] for name in self.seconds},
            },
        }


def reproduce(
    root: Path,
    params: Params,
    num_tests: int = NUM_TESTS,
    agents: Sequence[str] | None = None,
    seeds: Sequence[int] | None = None,
) -> Reproduction:
    """Test a project's trained agents as the article did, each policy `num_tests` times.

    Args:
        root: Folder of the project.
        params: Its parameters.
        num_tests: Number of tests of each policy.
        agents: Which of `AGENTS` to test, in this order; all by default.
        seeds: Which of its seeds to test; all by default.
    """
    agents, seeds = agents or AGENTS, list(seeds or params.seeds)
    world = World(robot.read(root), params.env)
    policies: dict[str, list[Any]] = {}
    seconds: dict[str, list[float]] = {}
    for name in agents:
        files = [Paths(root).agent(name).seed(seed) for seed in seeds]
        policies[name] = [trained_policy.load(own, True) for own in files]
        timed = curves.read_timed(root, params, name)
        seconds[name] = [float(timed[seed]["seconds"][-1]) for seed in seeds]
    totals: dict[str, Trace] = {}
    others: dict[str, Any] = {}
    if "dqn" in agents:
        block: Any = params.agent("dqn")
        dqns, epsilon = policies["dqn"], block.exploration_final_eps
        ours = test(world, dqns, seeds, num_tests, epsilon=epsilon)
        totals["dqn"] = Trace(printed_values.DQN_TOTALS, ours)
        others["control"] = control(world, dqns[0].actions, epsilon, len(seeds) * num_tests)
    if "sac" in agents:
        ours = test(world, policies["sac"], seeds, num_tests)
        totals["sac"] = Trace(printed_values.SAC_TOTALS, ours)
    if "pgpe" in agents:
        centers = policies["pgpe"]
        films = [without_normalizer(center) for center in centers]
        others["fitness"] = _fitness(root, params, seeds)
        others["film"] = _returns(world, films, seeds, num_tests)
        others["trained"] = _returns(world, centers, seeds, 1)[:, 0]
    return Reproduction(seeds, seconds, totals, **others)


def recorded(path: Path, run: str) -> Array:
    """Return the tests of a run in results/article_tests.csv (docs/article.md), by seed.

    Returns:
        Returns of 1,000 control steps, shape (num_seeds, NUM_TESTS).
    """
    table = pd.read_csv(path)
    return np.stack([own for _, own in table[table["run"] == run].groupby("seed")["return"]])


def play(
    world: World,
    act: Act,
    hold: int,
    seeds: Sequence[int],
    num_steps: int = printed_values.TEST_STEPS,
) -> Array:
    """Run without termination or reset, and return the rewards, (num_episodes, num_steps).

    `act` chooses torques, shape (num_episodes, num_motors), every `hold` control steps; each seed
    determines an episode's start. An episode's rewards are zero from its first state on that is not
    finite.
    """
    envs = RobotVectorEnv(world, len(seeds), machine.num_cores(), AutoresetMode.DISABLED)
    observations, _ = envs.reset(seed=list(seeds))
    rewards = np.zeros((len(seeds), num_steps))
    for step in range(num_steps):
        if step % hold == 0:
            torques = act(observations)
        observations, outcome, *_ = envs.advance(torques)
        rewards[:, step] = outcome.rewards
    envs.close()
    return rewards


def test(
    world: World,
    policies: Sequence[Any],
    seeds: Sequence[int],
    num_tests: int,
    **exploration: float,
) -> Array:
    """Test policies of an agent, which explore, as the article does, all at once.

    A policy's seed determines its start states and exploration; `exploration` goes to `explore`.

    Returns:
        Total rewards by control step, shape (num_policies, num_tests, TEST_STEPS).
    """
    generators = [
        [np.random.default_rng(derive(seed, "test", 2 * number + 1)) for number in range(num_tests)]
        for seed in seeds
    ]

    def act(observations: Array) -> Array:
        own = zip(policies, np.split(observations, len(policies)), generators, strict=True)
        return np.concatenate([policy.explore(*rest, **exploration) for policy, *rest in own])

    return _totals(world, act, policies[0].actions.hold, seeds, num_tests)


def _totals(world: World, act: Act, hold: int, seeds: Sequence[int], num_tests: int) -> Array:
    """Return total rewards by control step, shape (num_seeds, num_tests, TEST_STEPS)."""
    starts = [derive(seed, "test", 2 * number) for seed in seeds for number in range(num_tests)]
    rewards = play(world, act, hold, starts)
    return np.cumsum(rewards.reshape(len(seeds), num_tests, -1), axis=2)


def without_normalizer(policy: LinearPolicy) -> LinearPolicy:
    """Return the policy without normalisation of its observations."""
    return replace(policy, mean=np.zeros_like(policy.mean), stdev=np.ones_like(policy.stdev))


def control(world: World, actions: ActionSet, epsilon: float, num_tests: int) -> dict[str, Any]:
    """Test the command `CONTROL`, whatever is observed, as DQN is tested; see docs/article.md.

    It says how much learning the printed value takes. The interval of its probability is exact
    (Clopper and Pearson 1934), as these are independent tests of one policy.
    """
    biases = np.eye(len(world.env.commands), dtype=np.float32)[CONTROL]
    ignored = np.zeros(world.anatomy.num_observations, np.float32)
    always = GreedyCommands(ignored, actions, [(np.outer(biases, ignored), biases)])
    returns = test(world, [always], [0], num_tests, epsilon=epsilon)[0, :, -1]
    reached = int((returns >= max(printed_values.DQN_TOTALS.values())).sum())
    ends = stats.binomtest(reached, num_tests).proportion_ci(tail.CONFIDENCE)
    return {
        "command": CONTROL,
        "epsilon": epsilon,
        "tests": {"each": num_tests, "reached": [reached]},
        "mean": float(returns.mean()),
        "probability": {
            "value": reached / num_tests,
            "low": float(ends.low),
            "high": float(ends.high),
        },
    }


def place(value: float, tests: Array) -> dict[str, Any]:
    """Return where a printed value lies among ours, (num_seeds, num_tests): see docs/article.md."""
    ours = tests[:, 0]
    placed = {"value": value, "ours": ours.tolist(), "percentile": percentile_among(value, ours)}
    return placed | judge(value, tests) | _spread(ours)


def judge(value: float, tests: Array) -> dict[str, Any]:
    """Return how likely a test of a new policy is to lie as far out as a printed value.

    The side on which it lies further out counts, and two-sided p values are twice its probability.
    The value is not reproduced if that is at most `TOO_FAR_OUT`. It is reproduced if it is above
    `FAR_IN` even at the lower end of the probability's interval, and open otherwise.

    Args:
        value: The printed value.
        tests: Ours, shape (num_seeds, num_tests).

    Returns:
        The keys `tests`, `probability` and `reproduced`, which docs/article.md describes.
    """
    num_tests = tests.shape[1]
    sides = {"at or above": tests >= value, "at or below": tests <= value}
    reached = {side: where.sum(axis=1).tolist() for side, where in sides.items()}
    chances = {side: tail.probability(own, num_tests) for side, own in reached.items()}
    side, chance = min(chances.items(), key=lambda item: item[1].value)
    p = min(1.0, 2 * chance.value)
    is_beyond, is_within = p <= TOO_FAR_OUT, 2 * chance.low > FAR_IN
    return {
        "tests": {"each": num_tests, "reached": reached[side]},
        "probability": {"side": side, **asdict(chance), "p": p},
        "reproduced": False if is_beyond else True if is_within else None,
    }


def percentile_among(value: float, ours: Array) -> float:
    """Return the share of values below a given one [%]; equal values count half."""
    return float(100.0 * (np.mean(ours < value) + np.mean(ours == value) / 2))


def _spread(ours: Array) -> dict[str, float]:
    """Return the median, and the smallest and largest of the values in the central 95 %."""
    edge = (100.0 - CENTRAL) / 2
    central = [float(own) for own in ours if edge < percentile_among(own, ours) < 100.0 - edge]
    return {"median": float(np.median(ours)), "low": min(central), "high": max(central)}


def _returns(
    world: World, centers: Sequence[Policy], seeds: Sequence[int], num_tests: int
) -> Array:
    """Return each policy's returns over as many steps as the tests have, (num_seeds, num_tests)."""

    def act(observations: Array) -> Array:
        own = zip(centers, np.split(observations, len(centers)), strict=True)
        return np.concatenate([center.act(rows) for center, rows in own])

    return _totals(world, act, centers[0].actions.hold, seeds, num_tests)[:, :, -1]


def _fitness(root: Path, params: Params, seeds: Sequence[int]) -> dict[str, Trace]:
    """Return PGPE's fitness, with the same number of generations for every seed."""
    names = list(printed_values.PGPE_TRACES)
    needed = max(map(max, printed_values.PGPE_TRACES.values()))
    rows: dict[str, list[Array]] = {name: [] for name in names}
    for seed in seeds:
        curve = curves.read(root, "pgpe", seed)
        is_generation = ~np.isnan(curve["updates"])  # the other rows are from validation
        path = Paths(root).agent("pgpe").seed(seed).curve
        if (count := int(is_generation.sum())) < needed:
            raise InputError(f"{path}: given {count} generations, allowed: {needed} or more")
        for name in names:
            rows[name].append(curve[name][is_generation][:needed])
    return {
        name: Trace(printed_values.PGPE_TRACES[name], np.array(rows[name])[:, None])
        for name in names
    }
