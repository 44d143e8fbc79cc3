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
from soak.project import AGENT, Count

PATH = PROJECT_ROOT / "results" / "soak.json"
PARTS = ("kills", "faults", "bad_inputs", "mutations", "operations", "records")
SECTIONS = ("kills", "faults", "bad_inputs", "payloads", "mutations", "operations", "records")
MUTATIONS = 500  # changed versions of each file
OPERATIONS_SECONDS = 25.0  # for each stage and kind of interruption

Figures = dict[str, Any]


def main() -> None:
    """Parse the command line, run the parts, and exit with 1 if anything went wrong."""
    parser = command_line.parser(__doc__, "python -m soak")
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    parts = options.parts or PARTS
    if unknown := set(parts) - set(PARTS):
        parser.error(f"given {sorted(unknown)}, allowed: {', '.join(PARTS)}")
    started = time.monotonic()
    figures: Figures = {}
    troubles: list[str] = []
    generator = random.Random(options.seed)
    with checkout() as project:
        projects.prepare(project)
        if "bad_inputs" in parts:
            figures["bad_inputs"] = inputs.give(project, generator, troubles)
        if "mutations" in parts:
            figures |= change_files(project, options.seed, troubles)
        if "operations" in parts:
            figures |= interrupt_operations(project, options.seed, troubles)
        if "records" in parts:
            figures["records"] = records.keep(project, generator, troubles)
            project.write_params(projects.settings())
        deadline = started + 60 * options.minutes
        figures |= disturb_trainings(project, generator, deadline, parts, troubles)
    minutes = round((time.monotonic() - started) / 60, 1)
    figures = {"minutes": minutes} | {name: figures.get(name, {}) for name in SECTIONS}
    if options.parts and PATH.exists():
        figures = added(json.loads(PATH.read_text(encoding="utf-8")), figures)
    write_json(PATH, figures)
    print(json.dumps(figures, indent=2), *troubles, sep="\n")
    raise SystemExit(bool(troubles))


def added(stored: Figures, new: Figures) -> Figures:
    """Return the sums of figures in nested dictionaries."""
    return stored | {
        name: added(stored.get(name, {}), value)
        if isinstance(value, dict)
        else round(stored.get(name, 0) + value, 1)
        for name, value in new.items()
    }


def change_files(
    project: Checkout, seed: int, troubles: list[str], each: int = MUTATIONS
) -> Figures:
    """Change every kind of file; add what is not answered clearly, or runs, to the troubles."""
    project.write_params(projects.settings_of(*mutations.AGENTS))
    mutations.prepare(project)
    return _run(project, troubles, "mutations", str(project.folder), str(seed), str(each))


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
    return _run(project, troubles, "operations", AGENT, str(seed), str(seconds), *targets)


def _run(project: Checkout, troubles: list[str], module: str, *arguments: str) -> Figures:
    """Run a module that prints figures in the project, whose parameters it then puts back."""
    done = project.run(sys.executable, "-m", f"soak.{module}", *arguments)
    project.write_params(projects.settings())
    if done.returncode:
        troubles.append(f"{module} ended with {done.returncode}: {done.stderr[-2000:]}")
        return {}
    print(f"{module}: done", flush=True)
    figures: Figures = json.loads(done.stdout)
    troubles += figures.pop("troubles")
    return figures


def disturb_trainings(
    project: Checkout,
    generator: random.Random,
    deadline: float,
    parts: Collection[str],
    troubles: list[str],
) -> Figures:
    """Kill trainings and cause faults in turn until a deadline, each kind at least once."""
    kinds: dict[str, dict[str, tuple[Callable[[], None], Count]]] = {}
    if "kills" in parts:
        killers = {agent: Killer(project, agent, generator) for agent in projects.LEARNERS}
        kinds["kills"] = {agent: (killer.once, killer.count) for agent, killer in killers.items()}
    if "faults" in parts:
        counts = (faults := Faults(project, generator)).counts
        kinds["faults"] = {name: (partial(faults.once, name), counts[name]) for name in counts}
    least = max((len(kind) for kind in kinds.values()), default=0)
    for number in itertools.count():
        if number >= least and (not kinds or time.monotonic() > deadline):
            break
        for kind in kinds.values():
            name = list(kind)[number % len(kind)]
            disturb, count = kind[name]
            disturb()
            print(f"{name}: {count}", flush=True)
    for part, kind in kinds.items():
        for name, (_, count) in kind.items():
            done, survived = count.values()
            if survived < done:
                troubles.append(f"{part}: {name}: {survived} of {done} survived")
    return {part: {name: count for name, (_, count) in kinds[part].items()} for part in kinds}


if __name__ == "__main__":
    main()
