"""Every n-th operation on files fails, or is the last before a kill, in every stage and in DVC.

Usage: python -m soak.operations KIND NUMBER MODULE [ARGUMENT...]

Runs a module as `python -m MODULE ARGUMENT...` does. Operations are those that change files in the
current folder: opening one to write, flushing, linking, renaming, removing. Of these the one with
the given number fails as on a full disk (`fail`) or is preceded by a kill (`kill`). If there are
fewer, the module runs as it would anyhow.
"""

import errno
import itertools
import os
import runpy
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scripts.checkout import Checkout

KINDS = ("fail", "kill")
MARK = "interrupted:"
NEVER = 10**9
CHANGES = {"os.rename", "os.remove", "os.link", "os.symlink", "os.truncate"}


@dataclass
class Count:
    """Operations that failed or preceded a kill, and those after which all was as it should be."""

    interrupted: int = 0
    survived: int = 0


class _Interruption:
    """An audit hook that counts operations and ends one of them."""

    def __init__(self, kind: str, number: int, folder: Path) -> None:
        self._kind, self._left, self._folder = kind, number, str(folder) + os.sep

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
        self._left -= 1
        if self._left == -1:
            print(f"{MARK} {what}", file=sys.stderr, flush=True)
            if self._kind == "kill":
                os.kill(os.getpid(), signal.SIGKILL)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), what)


def main() -> None:
    """Parse the command line and run the module under the hook."""
    kind, number, module, *arguments = sys.argv[1:]
    hook = _Interruption(kind, int(number), Path.cwd())
    sys.argv = [module, *arguments]
    sys.addaudithook(hook)
    flush = os.fsync

    def fsync(descriptor: int) -> None:  # raises no audit event
        hook.count("fsync")
        flush(descriptor)

    os.fsync = fsync  # type: ignore[assignment]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


class Operations:
    """Interrupts the operations of a project's stages.

    Args:
        project: A prepared throw-away copy, with an agent trained and evaluated.
        agent: That agent.
    """

    def __init__(self, project: Checkout, agent: str) -> None:
        self.counts = {kind: Count() for kind in KINDS}
        self.troubles: list[str] = []
        self._project = project
        self._agent = agent

    def stage(self, kind: str, place: str, *command: str, step: int = 1) -> None:
        """Interrupt every `step`-th operation of a stage in turn, until it needs no more.

        After a failure, all of the stage's files are as they were or all are new; after a kill,
        each is one or the other. The next run makes the files that an undisturbed one makes.

        Args:
            kind: Which interruption.
            place: The folder of the stage's files.
            command: The stage's module and arguments.
            step: 1 to interrupt every operation.
        """
        self._run(*command)
        new = self._files(place)
        old = {path: content + b"\n" for path, content in new.items()}
        for number in itertools.count(step=step):
            for path, content in old.items():
                path.write_bytes(content)
            done = self._run(*command, kind=kind, number=number)
            if MARK not in done.stderr:
                break
            found = self._files(place)
            is_whole = all(found.get(path) in (new[path], old[path]) for path in new)
            if kind == "fail":
                is_clear = "Traceback" not in done.stderr
                is_whole = is_clear and found == (old if done.returncode else new)
            is_done = self._run(*command).returncode == 0 and self._files(place) == new
            self._count(kind, is_whole and is_done, done.stderr)

    def dvc(self, kind: str, number: int) -> None:
        """Interrupt an operation of `dvc repro` itself; the next one must complete its work."""
        place, stage = f"results/agents/{self._agent}", f"evaluate@{self._agent}"
        before = self._files(place)
        forced = ("dvc", "repro", "--force", "--single-item", stage)
        interrupted = self._run(*forced, kind=kind, number=number)
        done = self._run("dvc", "repro", stage)
        is_same = done.returncode == 0 and self._files(place) == before
        self._count(kind, is_same, interrupted.stderr[-500:] + done.stderr[-500:])

    def _files(self, place: str) -> dict[Path, bytes]:
        """Return the files that are the same in every run, without what killed writes left."""
        return {
            path: path.read_bytes()
            for path in sorted((self._project.folder / place).iterdir())
            if path.suffix in {".csv", ".json", ".npz", ".xml"}
            and path.name not in ("timing.csv", "scaling.csv")
        }

    def _run(
        self, *command: str, kind: str = "fail", number: int = NEVER
    ) -> subprocess.CompletedProcess[str]:
        arguments = ("-m", "soak.operations", kind, str(number), *command)
        return self._project.run(sys.executable, *arguments)

    def _count(self, kind: str, is_survived: bool, told: str) -> None:
        self.counts[kind].interrupted += 1
        self.counts[kind].survived += is_survived
        if not is_survived:
            self.troubles.append(f"{kind}: {' '.join(told.split())}")


if __name__ == "__main__":
    main()
