"""Run the pipeline with a preset, in a copy of the project.

Usage: python -m scripts.preset NAME [STAGE ...] (`make preset`)

The copy is `.presets/NAME/`, a whole project: `make ui` and `make view` work in it. The results in
this folder do not change. Another call updates the copy's code and parameters, unless you changed
them there; your files in it stay. A stopped run resumes from its checkpoints. Seeds that the
project or another copy has trained alike are not trained again.
"""

import os
import shlex
import signal
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import Timeout

from jumping_ant.base import command_line, locks, output
from jumping_ant.base.errors import InputError, StoppedError, WorkerError, reported
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.params import presets
from jumping_ant.params.model import Params
from scripts.checkout import Checkout, renew_project

FEW_SEEDS = 5  # fewer can't decide any claim: of 4 against 4, p is at least 0.029


def folder_of(name: str) -> Path:
    """Return the folder of a preset's copy."""
    return PROJECT_ROOT / ".presets" / name


def main() -> None:
    """Parse the command line and run."""
    parser = command_line.parser(__doc__)
    parser.add_argument("name", help="name of a file in presets/")
    parser.add_argument("stages", nargs="*", help="stages to run, with those that they need")
    options = parser.parse_args()
    params, folder = presets.load(options.name), folder_of(options.name)
    run(folder, params, options.stages)
    if options.stages:
        print(f"\nThe results: {folder}/results")
    else:
        make = f"make -C {shlex.quote(str(folder))}"
        print(
            f"\nThe report: {folder}/results/report.html, films: {folder}/media/*.mp4\n"
            f"MLflow: {make} ui, recordings in Rerun: {make} view AGENT=lineup"
        )
    if len(params.seeds) < FEW_SEEDS:
        print(
            f"{len(params.seeds)} seeds show what the robot does; they prove nothing about which "
            "learner is better. `make repro` asks that."
        )


def run(folder: Path, params: Params, targets: Sequence[str] = ()) -> None:
    """Run stages, by default all, with parameters in a copy's folder, resuming an earlier run.

    Raises:
        InputError: Another process does so, or somebody changed what an earlier call wrote there.
        StoppedError: A signal requested a stop.
        WorkerError: The pipeline failed; its own message is printed above.
    """
    with _alone(folder) as lock:
        renew_project(folder, params)
        installed = folder / ".venv"  # for the copy's `make`
        if installed.is_symlink():  # perhaps to where this project was before
            installed.unlink()
        with suppress(FileExistsError):
            installed.symlink_to(PROJECT_ROOT / ".venv")
        _share_trainings(folder, params)
        interrupts: list[int] = []  # DVC gets them, too, and saves a last checkpoint
        before = signal.signal(signal.SIGINT, lambda number, _: interrupts.append(number))
        called = ["python", "-m", "scripts.repro", *targets]
        # It holds the lock, too: a kill of this process alone leaves the pipeline running.
        done = subprocess.run(called, cwd=folder, env=Checkout(folder).environment, pass_fds=[lock])
        signal.signal(signal.SIGINT, before)
    if interrupts:
        raise StoppedError("the same command resumes from the last checkpoints")
    if done.returncode:
        raise WorkerError(
            f"`make repro` in {folder} ended with status {done.returncode}; see its output above; "
            "the same command resumes from there"
        )


def _share_trainings(folder: Path, params: Params) -> None:
    """Link a copy's seeds that were trained elsewhere; their keys say what they depend on."""
    for trained in (PROJECT_ROOT, *PROJECT_ROOT.glob(".presets/*")):
        for agent in params.agents:
            for path in (trained / ".checkpoints" / agent).glob("*/seed-*.finished"):
                link = folder / path.relative_to(trained)
                link.parent.mkdir(parents=True, exist_ok=True)
                with suppress(OSError):  # it has this one, or is on another disk and trains
                    os.link(path, link)


@contextmanager
def _alone(folder: Path) -> Iterator[int]:
    """Keep others from a copy, whose code they would replace; yield the lock's descriptor."""
    path = folder / ".dvc" / "tmp" / "preset.lock"
    held: list[int] = []
    try:
        with locks.lock(path, PROJECT_ROOT, blocking=False, on_acquired=held.append):
            yield held[0]
    except Timeout as error:
        raise InputError(
            f"{folder}: another process runs this preset; wait for its end, or stop it"
        ) from error


if __name__ == "__main__":
    output.tolerate_failures()
    with reported():
        main()
