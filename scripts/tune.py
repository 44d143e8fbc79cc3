"""Search settings for the algorithms of presets/families, with equal effort for each.

Usage: python -m scripts.tune [AGENT...] [--workers N]

Every agent gets as many trainings: its block of the preset and random draws from `SPACES` compete
with a part of the budget, and the best of them then gets all of it, on another seed. The comparison
uses none of these seeds and start states. The trainings are added to results/tuning.csv; those that
it has already are not repeated. The best settings are printed, to be put into the preset.
"""

import csv
import json
import os
import time
import zlib
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from jumping_ant.agents import kernels
from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.events import Finished
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.base import command_line, output
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.experiment import presets
from jumping_ant.experiment.models import TUNING_EPISODES, Params
from jumping_ant.policies import policy_file
from jumping_ant.sim import robot, rollout
from jumping_ant.sim.world import World
from jumping_ant.training import demonstrating

PATH = PROJECT_ROOT / "results" / "tuning.csv"
COLUMNS = ("agent", "trial", "seed", "share", "return", "seconds", "settings")
TRIALS = 6
SHARE = 0.4  # of the budget, in the first round
SEEDS = (100, 101)  # of the two rounds
EPISODES = TUNING_EPISODES[:12]  # of validation; demonstrations take the next ones
BUDGETS = ("total_steps", "generations")


@dataclass(frozen=True)
class Between:
    """Numbers from a range, drawn evenly on a logarithmic scale."""

    low: float
    high: float


Space = Mapping[str, Between | Sequence[Any]]
NETWORKS: Space = {"learning_rate": Between(2e-4, 2e-3), "gamma": (0.9, 0.93, 0.96)}
CRITICS: Space = {**NETWORKS, "gradient_steps": (2, 4, 8), "tau": (0.005, 0.01, 0.02)}
ENTROPY: Space = {"ent_coef": Between(0.02, 0.3)}
VALUES: Space = {
    **NETWORKS,
    "gradient_steps": (4, 8),
    "target_update_interval": (1000, 2000, 4000),
    "n_steps": (1, 2, 3),
}
FAR: Space = {"gamma": (0.97, 0.99, 0.999)}
ROUNDS: Space = {
    **NETWORKS,
    "gae_lambda": (0.9, 0.95, 1.0),
    "log_std_init": (-1.0, -0.5, 0.0),
    "vf_coef": Between(1e-4, 0.1),
}
WIDTHS: Space = {"stdev_init": Between(0.03, 0.5)}
RATES: Space = {
    "center_learning_rate": Between(0.3, 3.0),
    "stdev_learning_rate": Between(0.1, 3.0),
    **WIDTHS,
}
FITS: Space = {
    "learning_rate": Between(2e-4, 4e-3),
    "updates_per_round": (250, 500, 1000),
    "net_arch": ([64, 64], [128, 128], [256, 256]),
}
SPACES: dict[str, Space] = {
    "a2c": {
        **ROUNDS,
        "learning_rate": Between(2e-4, 5e-3),
        "n_steps": (5, 8, 16),
        "normalize_advantage": (True, False),
    },
    "ppo": {**ROUNDS, "n_steps": (8, 16, 32), "n_epochs": (5, 10)},
    "ddpg": {**CRITICS, "action_noise": Between(0.05, 0.5)},
    "td3": {
        **CRITICS,
        "action_noise": Between(0.1, 1.0),
        "learning_starts": (500, 2000, 4000),
    },
    "tqc": {**CRITICS, **ENTROPY, "top_quantiles_to_drop_per_net": (0, 2, 5)},
    "crossq": {**NETWORKS, **ENTROPY, "gradient_steps": (1, 2, 4)},
    "qrdqn": VALUES,
    "sac-sparse": {**CRITICS, **ENTROPY, **FAR},
    "dqn-sparse": {**VALUES, **FAR},
    "snes": RATES,
    "xnes": {**RATES, "stdev_learning_rate": Between(0.03, 1.0)},
    "cem": {**WIDTHS, "parenthood_ratio": (0.15, 0.25, 0.5)},
    "cmaes": {**WIDTHS, "separable": (True, False)},
    "ars": {
        "learning_rate": Between(0.005, 0.2),
        "delta_std": Between(0.03, 0.5),
        "n_top": (3, 5, 10),
    },
    "pgpe-commands": {
        "center_learning_rate": Between(0.02, 0.3),
        "stdev_init": Between(0.1, 1.0),
        "stdev_learning_rate": (0.05, 0.1, 0.2),
    },
    "bc": FITS,
    "dagger": FITS,
}


def main() -> None:
    """Parse the command line, and search."""
    parser = command_line.parser(__doc__)
    parser.add_argument("agents", nargs="*", metavar="AGENT", help=", ".join(SPACES))
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    arguments = parser.parse_args()
    if unknown := set(arguments.agents) - set(SPACES):
        parser.error(f"given {', '.join(sorted(unknown))}, allowed: {', '.join(SPACES)}")
    params = presets.load("families")
    names = arguments.agents or list(SPACES)
    trials = {name: list(_trials(params.agents[name], SPACES[name], name)) for name in names}
    imitates = any(params.agents[name].learns_from_demonstrations for name in names)
    with ProcessPoolExecutor(arguments.workers, initializer=_compute_with_one_thread) as pool:
        demonstrations = pool.submit(_demonstrations, params).result() if imitates else None
        run = partial(_train, pool, params, trials, demonstrations)
        run({name: range(TRIALS) for name in names}, SHARE, SEEDS[0])
        run({name: _best(name, SHARE)[:1] for name in names}, 1.0, SEEDS[1])
    for name in names:
        number, *_ = _best(name, 1.0)
        print(f"{name}: {json.dumps(_changes(params.agents[name], trials[name][number]))}")


def _trials(agent: AgentBlock, space: Space, name: str) -> Iterator[AgentBlock]:
    """Yield the settings that compete: those of the preset, then draws."""
    generator = np.random.default_rng(zlib.crc32(name.encode()))
    yield agent
    for _ in range(TRIALS - 1):
        drawn = {key: _draw(values, generator) for key, values in space.items()}
        yield type(agent).model_validate(agent.model_dump() | drawn)


def _draw(values: Between | Sequence[Any], generator: np.random.Generator) -> Any:
    if isinstance(values, Between):
        return float(f"{np.exp(generator.uniform(np.log(values.low), np.log(values.high))):.2g}")
    return values[int(generator.integers(len(values)))]


def _train(
    pool: ProcessPoolExecutor,
    params: Params,
    trials: Mapping[str, Sequence[AgentBlock]],
    demonstrations: bytes | None,
    chosen: Mapping[str, Sequence[int]],
    share: float,
    seed: int,
) -> None:
    """Train what is not in the table yet, and add it."""
    done = {(row["agent"], int(row["trial"]), float(row["share"])) for row in _rows()}
    waiting = {
        pool.submit(_run, params, trials[name][number], share, seed, demonstrations): (name, number)
        for name, numbers in chosen.items()
        for number in numbers
        if (name, number, share) not in done
    }
    for future in as_completed(waiting):
        name, number = waiting[future]
        value, seconds = future.result()
        changes = json.dumps(_changes(params.agents[name], trials[name][number]))
        _add((name, number, seed, share, f"{value:.1f}", f"{seconds:.1f}", changes))
        print(f"{name} {number}: {value:,.0f} in {seconds:.0f} s with {changes}", flush=True)


def _compute_with_one_thread() -> None:
    kernels.use()


def _run(
    params: Params, agent: AgentBlock, share: float, seed: int, demonstrations: bytes | None
) -> tuple[float, float]:
    """Return the mean return of the policy that a training ends with, and its seconds."""
    budget = {key: int(share * getattr(agent, key)) for key in BUDGETS if hasattr(agent, key)}
    world = World(robot.read(PROJECT_ROOT, agent.robot), params.env)
    started = time.perf_counter()
    block = type(agent).model_validate(agent.model_dump() | budget)
    policy = _train_policy(Job(world, block, seed, demonstrations=demonstrations))
    seconds = time.perf_counter() - started
    episodes = rollout.run(world, policy_file.parse(policy), EPISODES)
    return float(np.mean([episode.rewards.sum() for episode in episodes])), seconds


def _train_policy(job: Job[Any]) -> bytes:
    """Return the policy file that a training ends with."""
    *_, finished = trainer_of(job.agent)(job)
    assert isinstance(finished, Finished)
    return finished.policy


def _demonstrations(params: Params) -> bytes:
    """Return demonstrations by the agent of the preset, trained on another seed."""
    settings = params.demonstrations["bc"]
    agent = params.agent(settings.agent)
    world = World(robot.read(PROJECT_ROOT, agent.robot), params.env)
    expert = _train_policy(Job(world, agent, SEEDS[0]))
    other = settings.model_copy(update={"seed": EPISODES[-1] + 1})
    return demonstrating.record(world, expert, other).to_bytes()


def _changes(agent: AgentBlock, trial: AgentBlock) -> dict[str, Any]:
    """Return the settings of a trial that are not those of the preset."""
    own = agent.model_dump()
    return {key: value for key, value in trial.model_dump().items() if value != own[key]}


def _rows() -> list[dict[str, str]]:
    if not PATH.is_file():
        return []
    with PATH.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _add(row: Sequence[Any]) -> None:
    is_new = not PATH.is_file()
    with PATH.open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        if is_new:
            writer.writerow(COLUMNS)
        writer.writerow(row)


def _best(name: str, share: float) -> list[int]:
    """Return the trials of an agent with that share of the budget, the best first."""
    own = [row for row in _rows() if row["agent"] == name and float(row["share"]) == share]
    return [int(row["trial"]) for row in sorted(own, key=lambda row: -float(row["return"]))]


if __name__ == "__main__":
    output.tolerate_failures()
    main()
