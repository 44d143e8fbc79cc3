"""Inject faults into the project for some minutes, and write the counts to results/soak.json.

Usage: python -m soak [PART...] [--minutes MINUTES] [--seed SEED]

Without parts all of them run, and the file is recreated; with parts their figures are added to the
existing ones.
"""

import itertools
import json
import random
import sys
import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict
from functools import partial
from typing import Any

from jumping_ant.base import command_line
from jumping_ant.base.files import PROJECT_ROOT, write_json
from scripts.checkout import Checkout, checkout
from soak import inputs, mutations, records
from soak import project as projects
from soak.faults import Faults
from soak.kills import Killer
from soak.operations import DVC_STAGE, TARGETS
from soak.project import AGENT

PATH = PROJECT_ROOT / "results" / "soak.json"
PARTS = ("kills", "faults", "bad_inputs", "mutations", "operations", "records")
SECTIONS = ("kills", "faults", "bad_inputs", "payloads", "mutations", "operations", "records")
MUTATIONS = 500  # changed versions of each file
INPUTS = 5  # cut versions of each file
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
    with checkout() as project:
        projects.prepare(project)
        if "bad_inputs" in parts:
            figures |= give_bad_inputs(project, generator, troubles)
        if "mutations" in parts:
            figures |= change_files(project, arguments.seed, troubles)
        if "operations" in parts:
            figures |= interrupt_operations(project, arguments.seed, troubles)
        if "records" in parts:
            figures["records"] = records.keep(project, generator, troubles)
            project.write_params(projects.settings())
        figures |= disturb_trainings(project, generator, deadline, parts, troubles)
    minutes = (time.monotonic() - started) / 60
    figures = {"minutes": round(minutes, 1)} | {name: figures.get(name, {}) for name in SECTIONS}
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


def give_bad_inputs(
    project: Checkout, generator: random.Random, troubles: list[str], each: int = INPUTS
) -> Figures:
    """Give the stages files that are cut short; add unclear answers to the troubles."""
    project.seconds("dvc", "repro", f"evaluate@{AGENT}")
    figures: Figures = {}
    for _ in range(each):
        own = asdict(inputs.give(project, generator))
        troubles += own.pop("troubles")
        figures = added(figures, {"bad_inputs": own})
    return figures


def change_files(
    project: Checkout, seed: int, troubles: list[str], each: int = MUTATIONS
) -> Figures:
    """Change every kind of file; add what is not answered clearly, or runs, to the troubles."""
    project.write_params(projects.settings_of(*mutations.AGENTS))
    mutations.prepare(project)
    options = ("--seed", str(seed), "--each", str(each))
    figures = _run(project, troubles, "soak.mutations", str(project.folder), *options)
    for name, own in figures.get("mutations", {}).items():
        troubles += [f"{name}: {line}" for line in own.pop("troubles")]
    if figures.get("payloads", {}).get("executed"):
        troubles.append(f"code ran: {figures['payloads']}")
    return figures


def interrupt_operations(
    project: Checkout,
    seed: int,
    troubles: list[str],
    targets: Sequence[str] = TARGETS,
    seconds: float = OPERATIONS_SECONDS,
) -> Figures:
    """Interrupt operations on files; add what was not survived to the troubles."""
    project.write_params(projects.settings_of(AGENT))
    project.seconds("dvc", "repro", DVC_STAGE, *(set(targets) - {"dvc"}))
    options = ("--seconds", str(seconds), "--seed", str(seed))
    counts = _run(project, troubles, "soak.operations", AGENT, *targets, *options)
    for kinds in counts.values():
        for own in kinds.values():
            troubles += own.pop("troubles")
    return {"operations": counts}


def _run(project: Checkout, troubles: list[str], module: str, *arguments: str) -> Figures:
    """Run a module that prints counts in the project, whose parameters it then puts back."""
    done = project.run(sys.executable, "-m", module, *arguments)
    project.write_params(projects.settings())
    if done.returncode:
        troubles.append(f"{module} ended with {done.returncode}: {done.stderr[-2000:]}")
        return {}
    print(f"{module} is done", flush=True)
    figures: Figures = json.loads(done.stdout)
    return figures


def disturb_trainings(
    project: Checkout,
    generator: random.Random,
    deadline: float,
    parts: Collection[str],
    troubles: list[str],
) -> Figures:
    """Kill trainings and cause faults in turn until a deadline, each kind at least once."""
    kinds: dict[str, dict[str, Callable[[], None]]] = {}
    counts: dict[str, dict[str, Any]] = {}
    if "kills" in parts:
        killers = {agent: Killer(project, agent, generator) for agent in projects.LEARNERS}
        kinds["kills"] = {agent: killer.once for agent, killer in killers.items()}
        counts["kills"] = {agent: killer.count for agent, killer in killers.items()}
    if "faults" in parts:
        faults = Faults(project, generator)
        kinds["faults"] = {name: partial(faults.once, name) for name in faults.counts}
        counts["faults"] = faults.counts
    least = max((len(kind) for kind in kinds.values()), default=0)
    for number in itertools.count():
        if not kinds or (number >= least and time.monotonic() > deadline):
            break
        for part, kind in kinds.items():
            name = list(kind)[number % len(kind)]
            kind[name]()
            print(f"{name}: {counts[part][name]}", flush=True)
    figures = {
        part: {name: asdict(count) for name, count in own.items()} for part, own in counts.items()
    }
    for part, own in figures.items():
        for name, (done, survived) in ((name, count.values()) for name, count in own.items()):
            if survived < done:
                troubles.append(f"{part}: {name}: {survived} of {done} survived")
    return figures


if __name__ == "__main__":
    main()
