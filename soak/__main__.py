"""Inject faults into the project for some minutes, and write the counts to results/soak.json.

Usage: python -m soak [PART...] [--minutes MINUTES] [--seed SEED]

Without parts all of them run, and the file is recreated; with parts their figures are added to the
existing ones.
"""

import itertools
import json
import random
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from jumping_ant.base import command_line
from jumping_ant.base.files import PROJECT_ROOT, write_json
from scripts.checkout import Checkout, checkout
from soak import mutations, payloads
from soak import project as projects
from soak.faults import Faults
from soak.file_faults import FileFaults
from soak.injector import AGENT
from soak.inputs import Inputs
from soak.kills import Killer
from soak.operations import DVC_STAGE, TARGETS

PATH = PROJECT_ROOT / "results" / "soak.json"
PARTS = ("kills", "faults", "bad_inputs", "payloads", "mutations", "operations")
INPUTS_SHARE = 0.2  # share of the time for bad input, if other parts run, too
LEAST_INPUTS = 300
MUTATIONS = 500  # changed versions of each file
OPERATIONS_SECONDS = 25.0  # for each stage and kind of interruption

Figures = dict[str, Any]


def main() -> None:
    """Parse the command line, run the parts, and exit with 1 if anything went wrong."""
    parser = command_line.parser(__doc__, "python -m soak")
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    parts = arguments.parts or PARTS
    unknown = set(parts) - set(PARTS)
    if unknown:
        parser.error(f"given {sorted(unknown)}, allowed: {', '.join(PARTS)}")
    started = time.monotonic()
    deadline = started + 60 * arguments.minutes
    figures: Figures = {}
    troubles: list[str] = []
    generator = random.Random(arguments.seed)
    with checkout() as project, tempfile.TemporaryDirectory() as folder:
        projects.prepare(project)
        if "payloads" in parts:
            figures |= plant(Path(folder), troubles)
        if "bad_inputs" in parts:
            share = INPUTS_SHARE if {"kills", "faults"} & set(parts) else 1.0
            inputs_deadline = started + 60 * share * arguments.minutes
            figures |= mislead(project, generator, inputs_deadline, troubles)
        if "mutations" in parts:
            figures |= mutate(project, arguments.seed, troubles)
        if "operations" in parts:
            figures |= interrupt(project, arguments.seed, troubles)
        figures |= hurt(project, generator, deadline, parts, troubles)
    minutes = (time.monotonic() - started) / 60
    figures = {"minutes": round(minutes, 1)} | {part: figures.get(part, {}) for part in PARTS}
    if arguments.parts and PATH.exists():
        figures = added(json.loads(PATH.read_text(encoding="utf-8")), figures)
    write_json(PATH, figures)
    print(json.dumps(figures, indent=2))
    print("\n".join(troubles))
    raise SystemExit(bool(troubles))


def added(stored: Figures, new: Figures) -> Figures:
    """Return the sums of figures in nested dictionaries."""
    return stored | {
        name: added(stored.get(name, {}), value)
        if isinstance(value, dict)
        else round(stored.get(name, 0) + value, 1)
        for name, value in new.items()
    }


def plant(folder: Path, troubles: list[str]) -> Figures:
    """Plant code in files; add a line to the troubles if any ran."""
    count = payloads.plant_everywhere(folder)
    if count.executed:
        troubles.append(f"{count.executed} of {count.planted} planted payloads ran")
    return {"payloads": asdict(count)}


def mislead(
    project: Checkout, generator: random.Random, deadline: float, troubles: list[str]
) -> Figures:
    """Give bad input until a deadline, and a least number; add unclear answers to the troubles."""
    project.seconds("dvc", "repro", f"evaluate@{AGENT}")
    inputs = Inputs(project, generator)
    inputs.try_another_robot()
    while time.monotonic() < deadline or inputs.count.tried < LEAST_INPUTS:
        if not inputs.try_params():
            break
        if inputs.count.tried % 20 == 0:
            inputs.try_files()
            print(f"bad inputs: {asdict(inputs.count)}", flush=True)
    troubles += inputs.unclear
    return {"bad_inputs": asdict(inputs.count)}


def mutate(project: Checkout, seed: int, troubles: list[str], each: int = MUTATIONS) -> Figures:
    """Change bytes of every kind of file; add what is not answered clearly to the troubles."""
    project.write_params(projects.settings_of(*mutations.AGENTS))
    mutations.prepare(project)
    command = ("soak.mutations", str(project.folder), "--seed", str(seed), "--each", str(each))
    done = project.run(sys.executable, "-m", *command)
    project.write_params(projects.settings())
    if done.returncode:
        troubles.append(f"mutations ended with {done.returncode}: {done.stderr[-2000:]}")
        return {}
    counts = json.loads(done.stdout)
    troubles += [f"{name}: {line}" for name, own in counts.items() for line in own["troubles"]]
    print(f"mutations: {sum(own['tried'] for own in counts.values())}", flush=True)
    kept = ("tried", "clear")
    return {"mutations": {name: {key: own[key] for key in kept} for name, own in counts.items()}}


def interrupt(
    project: Checkout,
    seed: int,
    troubles: list[str],
    targets: Sequence[str] = TARGETS,
    seconds: float = OPERATIONS_SECONDS,
) -> Figures:
    """Interrupt operations on files; add what was not survived to the troubles."""
    project.write_params(projects.settings_of(AGENT))
    project.seconds("dvc", "repro", DVC_STAGE, *(set(targets) - {"dvc"}))
    command = ("soak.operations", AGENT, *targets, "--seconds", str(seconds), "--seed", str(seed))
    done = project.run(sys.executable, "-m", *command)
    project.write_params(projects.settings())
    if done.returncode:
        troubles.append(f"operations ended with {done.returncode}: {done.stderr[-2000:]}")
        return {}
    counts = json.loads(done.stdout)
    for kinds in counts.values():
        for own in kinds.values():
            troubles += own.pop("troubles")
    print(f"operations: {counts}", flush=True)
    return {"operations": counts}


def hurt(
    project: Checkout,
    generator: random.Random,
    deadline: float,
    parts: tuple[str, ...] | list[str],
    troubles: list[str],
) -> Figures:
    """Kill trainings and cause faults in turn until a deadline, each kind at least once."""
    kinds: list[dict[str, Any]] = []
    figures: Figures = {}
    if "kills" in parts:
        killers = {agent: Killer(project, agent, generator) for agent in projects.LEARNERS}
        kinds.append({agent: killer.once for agent, killer in killers.items()})
        figures["kills"] = {agent: killer.count for agent, killer in killers.items()}
    if "faults" in parts:
        injectors = (Faults(project, generator), FileFaults(project, generator))
        kinds.append({name: partial(one.once, name) for one in injectors for name in one.counts})
        figures["faults"] = {name: one.counts[name] for one in injectors for name in one.counts}
    least = max((len(kind) for kind in kinds), default=0)
    for number in itertools.count():
        if not kinds or (number >= least and time.monotonic() > deadline):
            break
        for kind in kinds:
            name = list(kind)[number % len(kind)]
            kind[name]()
            print(f"{name}: {_count(figures, name)}", flush=True)
    for part in figures:
        for name, count in figures[part].items():
            done, survived = asdict(count).values()
            if survived < done:
                troubles.append(f"{part}: {name}: {survived} of {done} survived")
    return {
        part: {name: asdict(count) for name, count in counts.items()}
        for part, counts in figures.items()
    }


def _count(figures: Figures, name: str) -> object:
    return next(counts[name] for counts in figures.values() if name in counts)


if __name__ == "__main__":
    main()
