"""Ill-treat the project for some minutes, and write what it survived to results/soak.json.

Usage: python -m soak [--minutes MINUTES] [--seed SEED]
"""

import argparse
import itertools
import json
import random
import tempfile
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.checkout import Checkout, checkout
from jumping_ant.files import PROJECT_ROOT, write_json
from soak import payloads
from soak import project as projects
from soak.faults import Faults
from soak.inputs import Inputs
from soak.kills import Killer

PATH = PROJECT_ROOT / "results" / "soak.json"
INPUTS_SHARE = 0.2  # of the time, for bad input


def main() -> None:
    """Parse the command line, go through everything in turn, and exit with 1 if anything failed."""
    parser = argparse.ArgumentParser(prog="python -m soak", description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    started = time.monotonic()
    generator = random.Random(arguments.seed)
    with checkout() as project, tempfile.TemporaryDirectory() as folder:
        figures, troubles = soak(project, Path(folder), generator, 60 * arguments.minutes)
    write_json(PATH, {"minutes": round((time.monotonic() - started) / 60, 1), **figures})
    print(json.dumps(figures, indent=2))
    for trouble in troubles:
        print(trouble)
    raise SystemExit(bool(troubles))


def soak(
    project: Checkout, folder: Path, generator: random.Random, seconds: float
) -> tuple[dict[str, Any], list[str]]:
    """Ill-treat a project.

    Args:
        project: A throw-away copy of it.
        folder: An empty one, for planted files.
        generator: Decides everything.
        seconds: How long; every kind of trouble is caused at least once.

    Returns:
        The figures, and a line on each thing that was not survived.
    """
    deadline = time.monotonic() + seconds
    projects.prepare(project)
    planted = payloads.plant_everywhere(folder)
    print(f"payloads: {planted.planted} planted, {planted.executed} executed", flush=True)
    killers = {agent: Killer(project, agent, generator) for agent in projects.BUDGETS}
    faults = Faults(project, generator)
    project.seconds("dvc", "repro", f"evaluate@{faults.agent}")
    inputs = Inputs(project, generator)
    inputs.try_another_robot()
    inputs_end = time.monotonic() + INPUTS_SHARE * (deadline - time.monotonic())
    while time.monotonic() < inputs_end and inputs.try_params():
        if inputs.count.tried % 20 == 0:
            inputs.try_files()
            print(f"bad inputs: {asdict(inputs.count)}", flush=True)
    troubles = list(inputs.unclear)
    for number in itertools.count():
        is_first_round = number < len(faults.counts)
        if not is_first_round and time.monotonic() > deadline:
            break
        name = list(faults.counts)[number % len(faults.counts)]
        faults.once(name)
        agent = list(killers)[number % len(killers)]
        killers[agent].once()
        print(f"{name}: {faults.counts[name]}; {agent}: {killers[agent].count}", flush=True)
    figures: dict[str, Any] = {
        "kills": {agent: asdict(killer.count) for agent, killer in killers.items()},
        "faults": {name: asdict(count) for name, count in faults.counts.items()},
        "bad_inputs": asdict(inputs.count),
        "payloads": asdict(planted),
    }
    troubles += [
        f"{agent}: bytes differ after a kill"
        for agent, killer in killers.items()
        if killer.count.identical < killer.count.killed
    ]
    troubles += [
        f"{name}: not survived"
        for name, count in faults.counts.items()
        if count.survived < count.injected
    ]
    return figures, troubles


if __name__ == "__main__":
    main()
