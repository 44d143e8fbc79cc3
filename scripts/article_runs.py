"""Train and test the article's DQN on many seeds, here and with its author's own versions.

Usage: python -m scripts.article_runs [--run RUN ...] [--seed SEED ...]

Three runs, which differ in one thing each:

- `original`: the author's versions of the libraries (see `scripts/article_original.py`);
- `preset`: this project's training with `presets/article`;
- `wide-margin`: the same with contacts that begin at 0.02 m instead of 0.01 m.

Each final policy is tested as the article tested its one. A seed's tests are added to
results/article_tests.csv as soon as it is trained, and what is there is not trained again: stop at
any time, and resume on another day or on another machine. Processes that run at once need different
runs or seeds.
"""

import csv
import io
import itertools
import json
import os
import shutil
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.agents import kernels
from jumping_ant.agents.events import Finished
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.article import printed_values, reproduction
from jumping_ant.base import command_line, output, portable
from jumping_ant.base.errors import InputError, WorkerError, reported
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.comparison import estimates, hypothesis_tests
from jumping_ant.experiment import presets
from jumping_ant.experiment.models import Params
from jumping_ant.policies import policy_file
from jumping_ant.sim import robot
from jumping_ant.sim.world import World

PATH = PROJECT_ROOT / "results" / "article_tests.csv"
ORIGINAL = PROJECT_ROOT / "scripts" / "article_original.py"
SEEDS = {"original": range(30, 46), "preset": range(30, 70), "wide-margin": range(30, 46)}
PAIRS = [("original", "preset"), ("wide-margin", "preset")]  # which are compared
COLUMNS = ("run", "seed", "test", "return")

Array = NDArray[np.float64]


def main() -> None:
    """Parse the command line, train and test."""
    parser = command_line.parser(__doc__)
    parser.add_argument("--run", nargs="+", choices=SEEDS, default=list(SEEDS))
    parser.add_argument("--seed", nargs="+", type=int, help="by default those of each run")
    options = parser.parse_args()
    kernels.use()
    params = presets.load("article")
    for run, seed in plan(options.run, options.seed):
        if (run, seed) in read(PATH):
            continue
        started = time.perf_counter()
        returns = original(seed) if run == "original" else ours(params, run, seed)
        add(PATH, run, seed, returns)
        print(
            f"{run} {seed}: {max(returns):.1f}, {time.perf_counter() - started:.0f} s", flush=True
        )


def plan(runs: Sequence[str], seeds: Sequence[int] | None = None) -> list[tuple[str, int]]:
    """Return what to train, in order: a seed of every run, then the next."""
    every = itertools.chain(*SEEDS.values()) if seeds is None else seeds
    return [
        (run, seed)
        for seed in sorted(set(every))
        for run in runs
        if seeds is not None or seed in SEEDS[run]
    ]


def original(seed: int) -> list[float]:
    """Return the tests' returns of a seed trained with the author's versions."""
    if not (uv := shutil.which("uv")):
        raise InputError(
            "uv: given none on the PATH, allowed: that of `make install`; run "
            "`source .venv/bin/activate`"
        )
    command = [uv, "run", "--quiet", "--no-project", "--script", str(ORIGINAL)]
    command += [str(seed), str(reproduction.NUM_TESTS)]
    # Switches for today's kernels are not all known to the old versions.
    environment = {name: own for name, own in os.environ.items() if name not in portable.SWITCHES}
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True)
    if done.returncode:
        raise WorkerError(f"{' '.join(command)} ended with status {done.returncode}")
    returns: list[float] = json.loads(done.stdout)["returns"]
    return returns


def ours(params: Params, run: str, seed: int) -> list[float]:
    """Return the tests' returns of a seed trained by this project."""
    edits = params.robot
    if run == "wide-margin":
        edits = edits.model_copy(update={"contact_margin": None})
    world = World(robot.build(edits), params.env)
    agent = params.agent("dqn")
    *_, finished = trainer_of(agent)(Job(world, agent, seed))
    assert isinstance(finished, Finished)
    epsilon = agent.exploration_final_eps  # type: ignore[attr-defined]
    policy = policy_file.parse(finished.policy)
    totals = reproduction.test(world, [policy], [seed], reproduction.NUM_TESTS, epsilon=epsilon)
    last: list[float] = totals[0, :, -1].tolist()
    return last


def summary(path: Path) -> dict[str, Any]:
    """Return what the tests say of each run that has any, and of each pair of runs.

    The sample of a pair's test is a policy's mean return.
    """
    options, value = presets.load("article").compare, max(printed_values.DQN_TOTALS.values())
    found = {run: own for run in SEEDS if len(own := tests(path, run))}
    means = {run: own.mean(axis=1) for run, own in found.items()}
    return {
        "runs": {
            run: {"means": means[run].tolist()} | reproduction.judge(value, own)
            for run, own in found.items()
        },
        "pairs": [
            {"first": first, "second": second}
            | estimates.probability_of_improvement(means[first], means[second], options).as_dict(
                "probability"
            )
            | {"p": hypothesis_tests.rank_test(means[first], means[second], options.seed)}
            for first, second in PAIRS
            if first in means and second in means
        ],
    }


def tests(path: Path, run: str) -> Array:
    """Return the returns of a run's tests, shape (num_seeds, NUM_TESTS), by increasing seed."""
    own = {seed: returns for (name, seed), returns in read(path).items() if name == run}
    return np.array([own[seed] for seed in sorted(own)]).reshape(-1, reproduction.NUM_TESTS)


def read(path: Path) -> dict[tuple[str, int], list[float]]:
    """Return the returns of every test, by run and seed.

    Raises:
        InputError: The file lacks tests of a seed.
    """
    if not path.is_file():
        return {}
    found: dict[tuple[str, int], list[float]] = {}
    for row in csv.DictReader(path.read_text(encoding="utf-8").splitlines()):
        found.setdefault((row["run"], int(row["seed"])), []).append(float(row["return"]))
    for (run, seed), returns in found.items():
        if len(returns) != reproduction.NUM_TESTS:
            raise InputError(
                f"{path}: given {len(returns)} tests of {run} {seed}, allowed: "
                f"{reproduction.NUM_TESTS}; delete their lines, and run this again"
            )
    return found


def add(path: Path, run: str, seed: int, returns: Sequence[float]) -> None:
    """Append the tests of a seed in one write, which other processes cannot interrupt."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows((run, seed, number, f"{own:.3f}") for number, own in enumerate(returns))
    header = "" if path.is_file() else ",".join(COLUMNS) + "\n"
    with path.open("a", encoding="utf-8") as file:
        file.write(header + text.getvalue())


if __name__ == "__main__":
    output.tolerate_failures()
    with reported():
        main()
