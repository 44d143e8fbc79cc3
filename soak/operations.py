"""Every n-th operation on files fails, or is preceded by a kill, in every stage and in DVC.

Usage: python -m soak.operations AGENT SEED SECONDS TARGET...

Runs in the folder of a project whose stages are up to date, interrupts each target in both ways for
so many seconds, and prints the figures as JSON. Operations are those that change files in that
folder: opening one to write, flushing, linking, renaming, removing. One of them fails as on a full
disk, or the process is killed just before it.
After that, each output of a stage is as it was or new. The next run completes the work, with the
same content.

Every run is a fork of this process, which has imported the target.
"""

import errno
import importlib
import json
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from dvc.cli import main as dvc  # type: ignore[import-untyped]
from ruamel.yaml import YAML

import stages
from jumping_ant.base.files import write_bytes
from soak.project import Count

KINDS = ("fail", "kill")
DVC_STAGE = "build"
TARGETS = (
    *("digest", "check", "build", "train", "demonstrate", "evaluate", "robustness"),
    *("record", "lineup", "compare", "timing", "report", "track", "play"),
    "dvc",  # while it runs that stage
)
PRELOADED = {
    "train": ("jumping_ant.training.driver", "jumping_ant.agents.evolution.trainer"),
    "dvc": ("dvc.commands.repro", "dvc.repo", "dvc.ignore", "dvc.repo.fetch", "dvc.stage.cache"),
}
OLD = b"as it was before\n"
A_FEW = 2
MARK, TOTAL = "interrupted: ", "operations: "
CHANGES = {"os.rename", "os.remove", "os.link", "os.symlink", "os.truncate"}
GROWING = "curve.csv"  # row by row, while training runs
MEASURED = ("timing.csv", "scaling.csv")  # other seconds each time


@dataclass(frozen=True)
class Ended:
    """How a run ended; the status is negative for a signal."""

    status: int
    output: str


def main() -> None:
    """Interrupt the targets, and print the figures."""
    agent, seed, seconds, *names = sys.argv[1:]
    generator = random.Random(int(seed))
    counts, troubles = {}, []
    for name in names:
        target = Target(name, agent)
        counts[name] = target.interrupt(float(seconds), generator)
        troubles += target.troubles
        print(f"operations: {name}: {counts[name]}", file=sys.stderr, flush=True)
    print(json.dumps({"operations": counts, "troubles": troubles}))


class Target:
    """One of `TARGETS`: a stage, for an agent if it takes one, or DVC when it runs a stage."""

    def __init__(self, name: str, agent: str) -> None:
        self.troubles: list[str] = []
        self._name = name
        stage = DVC_STAGE if name == "dvc" else name
        lock = YAML(typ="safe", pure=True).load(Path("dvc.lock").read_text(encoding="utf-8"))
        full_names = [name for name in lock["stages"] if name.partition("@")[0] == stage]
        full_name = f"{stage}@{agent}" if f"{stage}@{agent}" in full_names else full_names[0]
        arguments = full_name.split("@")[1:]
        self._outs = [Path(out["path"]) for out in lock["stages"][full_name].get("outs", [])]
        for preloaded in PRELOADED.get(name, ()):  # as the target does later
            importlib.import_module(preloaded)
        module = importlib.import_module(f"stages.{stage}")
        self._first = self._again = partial(_run_stage, module.main, [stage, *arguments])
        if name == "dvc":
            self._first = partial(dvc, ["repro", "--force", full_name])
            self._again = partial(dvc, ["repro", full_name])

    def interrupt(self, seconds: float, generator: random.Random) -> dict[str, Count]:
        """Interrupt each operation once, or as many as there is time for; return the counts."""
        self._reset()
        undisturbed = self._run(self._first)
        new = self._contents()
        total = int(undisturbed.output.rpartition(TOTAL)[2])
        counts = {kind: {"interrupted": 0, "survived": 0} for kind in KINDS}
        for kind, count in counts.items():
            deadline = time.monotonic() + seconds
            for done, number in enumerate(generator.sample(range(total), total)):
                if done >= A_FEW and time.monotonic() > deadline:
                    break
                self._reset()
                ended = self._run(self._first, kind, number)
                is_whole = self._is_whole(kind, ended, new)
                again = self._run(self._again)
                if MARK in ended.output:  # there may be fewer operations than the first time
                    is_survived = is_whole and again.status == 0 and self._is_done(new)
                    count["interrupted"] += 1
                    count["survived"] += is_survived
                    if not is_survived:
                        output = " ".join((ended.output + again.output).split())
                        self.troubles.append(f"{self._name}: {kind} {number}: {output[-1000:]}")
        return counts

    def _is_whole(self, kind: str, ended: Ended, new: dict[Path, bytes]) -> bool:
        """Tell whether an interrupted run left its outputs as it should."""
        if self._name == "dvc":  # removes a stage's outputs before it runs it
            return True
        found = self._contents()
        states = {
            {None: "missing", OLD: "old", content: "new"}.get(found.get(path), "torn")
            for path, content in new.items()
            if path.name != GROWING
        }
        if kind == "fail" and ("Traceback" in ended.output or ended.status not in (0, 1, 2)):
            return False
        if self._name == "train":  # removes its outputs as well, and writes them seed by seed
            return states <= {"old", "new", "missing"}
        if kind == "fail" and ended.status == 0:
            return states <= {"new"}
        return states <= {"old", "new"}

    def _is_done(self, new: dict[Path, bytes]) -> bool:
        """Tell whether all is as without interruptions."""
        if self._name == "track":  # its outputs are in MLflow
            return not re.search("created|replaced", self._run(self._again).output)
        return self._contents() == new

    def _reset(self) -> None:
        """Restore the state before the stage has run, with outputs of an earlier run."""
        for path in self._files():
            write_bytes(path, OLD)  # DVC may have linked it
        if self._name == "train":
            shutil.rmtree(".checkpoints", ignore_errors=True)
        if self._name == "track":
            Path("mlflow.db").unlink(missing_ok=True)
            shutil.rmtree("mlartifacts", ignore_errors=True)

    def _files(self) -> list[Path]:
        listed = [path for out in self._outs for path in (out, *out.rglob("*"))]
        return sorted(path for path in listed if path.is_file())

    def _contents(self) -> dict[Path, bytes]:
        return {path: _content(path) for path in self._files()}

    def _run(self, target: Callable[[], int], kind: str = "", number: int = -1) -> Ended:
        """Run a target in a fork of this process, and interrupt an operation of a number."""
        with tempfile.TemporaryFile() as output:
            sys.stdout.flush()
            child = os.fork()
            if child == 0:
                _become(target, output.fileno(), kind, number)
            _, status = os.waitpid(child, 0)
            output.seek(0)
            return Ended(os.waitstatus_to_exitcode(status), output.read().decode(errors="replace"))


class _Interruption:
    """An audit hook that counts operations and ends one of them."""

    def __init__(self, kind: str, number: int) -> None:
        self.counted = 0
        self._kind, self._number, self._folder = kind, number, str(Path.cwd()) + os.sep

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            path, _, flags = arguments
            is_change = bool(flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT))
        else:
            path, is_change = arguments[0] if arguments else None, event in CHANGES
        is_path = isinstance(path, str | os.PathLike)
        if is_change and is_path and os.path.abspath(os.fspath(path)).startswith(self._folder):
            self.count(f"{event} {path}")

    def count(self, what: str) -> None:
        """Count an operation, and end it if its turn has come."""
        self.counted += 1
        if self.counted == self._number + 1:
            print(f"{MARK}{what}", file=sys.stderr, flush=True)
            if self._kind == "kill":
                os.kill(os.getpid(), signal.SIGKILL)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), what)


def _become(target: Callable[[], int], output: int, kind: str, number: int) -> NoReturn:
    """Run a target under the hook in this process, a fork, and end it."""
    os.setsid()
    for stream in (1, 2):
        os.dup2(output, stream)
    interruption = _Interruption(kind, number)
    sys.addaudithook(interruption)
    flush = os.fsync

    def fsync(descriptor: int) -> None:  # raises no audit event
        interruption.count("fsync")
        flush(descriptor)

    os.fsync = fsync  # type: ignore[assignment]
    status = 70
    try:
        status = target()
    except BaseException:
        traceback.print_exc()
    finally:
        print(f"{TOTAL}{interruption.counted}", flush=True)
        sys.stderr.flush()
        os._exit(status)


def _run_stage(stage: Callable[[], None], command_line: list[str]) -> int:
    sys.argv = command_line
    try:
        stages.run(stage)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 1
    return 0


def _content(path: Path) -> bytes:
    """Return what a file holds that is the same in every run."""
    content = path.read_bytes()
    if content == OLD:
        return content
    if path.suffix == ".rrd":  # its ids differ
        return content[:4]
    return re.sub(rb"[^,\n]", b"", content) if path.name in MEASURED else content


if __name__ == "__main__":
    main()
