"""Checkpoints of an agent's seeds on disk, to resume from after a kill.

The folder `.checkpoints/<agent>/<key>/` lies outside DVC's outputs, which DVC deletes before a
stage runs, and outside the folders where DVC runs experiments, which it deletes afterwards. The key
is a digest of everything that a seed's results depend on, so checkpoints of other parameters,
another robot, other code or other versions are never resumed from. The folder contains:

| file | content |
|---|---|
| seed-N.M.checkpoint | seed N at its M-th checkpoint; the last two are kept |
| seed-N.finished | seed N, finished |

Every file is complete or absent (see `jumping_ant.base.files`), begins with the digest of the rest,
states the agent, seed and key that it is of, and holds numbers and text: nothing in it is executed.

Finished seeds are kept after training, so that a training with more seeds trains only the new ones.
Files of other keys are kept, too, so that a return to earlier parameters resumes what they had
reached; the oldest ones are removed when they take more than `KEPT_BYTES`.
"""

import fcntl
import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, TextIO

from jumping_ant.base.archive import Archive, pack
from jumping_ant.base.errors import told
from jumping_ant.base.files import write_bytes
from jumping_ant.base.paths import home
from jumping_ant.training.racing import Candidate, Candidates

GENERATIONS = 2
KEPT_BYTES = 2 * 2**30  # for an agent, of other parameters and of seeds that are not trained now
_HEADER, _CONTENT = "header.json", "content"
_IN_ENTRIES = ("candidates", "content")


@dataclass(frozen=True)
class Owner:
    """Whose a checkpoint is; its place says the same."""

    agent: str
    seed: int
    key: str  # digest of what the seed's results depend on

    def __str__(self) -> str:
        return f"agent {self.agent}, seed {self.seed}, key {self.key}"


@dataclass(frozen=True)
class Saved:
    """The saved state of a seed."""

    env_steps: int
    seconds: float  # of training
    timing: list[tuple[int, float]]  # (control steps, training seconds) at each row of the curve
    machine: dict[str, Any] | None  # of a finished seed: where it was trained
    curve: str  # content of `curve.csv`
    candidates: Candidates  # snapshots that may be published
    content: bytes  # the trainer's checkpoint; of a finished seed, the last policy's file

    def to_bytes(self, owner: Owner) -> bytes:
        """Return the content of the owner's file."""
        others = (field.name for field in fields(self) if field.name not in _IN_ENTRIES)
        header = {name: getattr(self, name) for name in others} | {"owner": asdict(owner)}
        header["candidates"] = [(one.env_steps, one.returns) for one in self.candidates]
        policies = {_policy(rank): one.policy for rank, one in enumerate(self.candidates)}
        packed = pack({_HEADER: json.dumps(header).encode(), **policies, _CONTENT: self.content})
        return hashlib.sha256(packed).hexdigest().encode() + b"\n" + packed

    @classmethod
    def from_bytes(cls, file: bytes, owner: Owner) -> "Saved":
        """Read the owner's file; a damaged one or another owner's raises a ValueError."""
        digest, _, packed = file.partition(b"\n")
        if hashlib.sha256(packed).hexdigest().encode() != digest:
            raise ValueError("the digest does not match")
        entries = Archive(packed)
        header = json.loads(entries[_HEADER])
        if (stated := header.pop("owner")) != asdict(owner):
            raise ValueError(f"it is that of {Owner(**stated)}, not of {owner}")
        header["timing"] = [tuple(row) for row in header["timing"]]
        header["candidates"] = tuple(
            Candidate(env_steps, tuple(returns), entries[_policy(rank)])
            for rank, (env_steps, returns) in enumerate(header["candidates"])
        )
        return cls(content=entries[_CONTENT], **header)


def _policy(rank: int) -> str:
    """Return the name of a candidate's policy in a file."""
    return f"candidate-{rank}"


class Checkpoints:
    """The checkpoints of an agent's seeds; `key` is the digest of what their results depend on."""

    def __init__(self, root: Path, agent: str, key: str, say: Callable[[str], None]) -> None:
        self._workspace = root / ".checkpoints" / agent
        self._agent, self._key = agent, key
        self._agent_folder = home(root) / ".checkpoints" / agent
        self._folder = self._agent_folder / key
        self._say = say

    @contextmanager
    def opened(self, seeds: Iterable[int]) -> Iterator[None]:
        """Lock the agent and its checkpoints while it trains; clean up if training finishes.

        Another process may be training the agent already, such as one whose `dvc repro` was killed.
        This waits until it ends, then resumes from its last checkpoint.
        """
        with ExitStack() as stack:
            for folder in (self._workspace, self._folder):
                folder.mkdir(parents=True, exist_ok=True)
                self._take(stack.enter_context((folder / "lock").open("a+", encoding="utf-8")))
            yield
            self._remove_oldest(seeds)

    def load(self, seed: int) -> Saved | None:
        """Return a seed's newest undamaged checkpoint, if any; remove newer, damaged ones."""
        for path in reversed(self._generations(seed)):
            if saved := self._read(path, seed):
                return saved
            path.unlink()
        return None

    def reject(self, seed: int, reason: str) -> None:
        """Remove a seed's newest checkpoint, which the trainer cannot resume from."""
        newest = self._generations(seed)[-1]
        self._say(f"{newest.name} cannot be resumed from ({reason}) and is not used")
        newest.unlink()

    def finished(self, seed: int) -> Saved | None:
        """Return a seed that is already trained, None if it is not."""
        path = self._finished_path(seed)
        return self._read(path, seed) if path.exists() else None

    def forget(self, seed: int) -> None:
        """Remove a finished seed, so that it is trained again."""
        self._finished_path(seed).unlink(missing_ok=True)

    def save(self, seed: int, saved: Saved) -> None:
        """Write a seed's next checkpoint; older ones stay if that fails, as on a full disk."""
        old = self._generations(seed)
        number = int(old[-1].suffixes[-2][1:]) + 1 if old else 1
        path = self._folder / f"seed-{seed}.{number}.checkpoint"
        write_bytes(path, saved.to_bytes(self._owner(seed)))
        for path in old[: 1 - GENERATIONS]:
            path.unlink()

    def finish(self, seed: int, saved: Saved) -> None:
        """Write a trained seed, then remove its checkpoints; they stay if writing fails."""
        write_bytes(self._finished_path(seed), saved.to_bytes(self._owner(seed)))
        for path in self._generations(seed):
            path.unlink()

    def _owner(self, seed: int) -> Owner:
        return Owner(self._agent, seed, self._key)

    def _read(self, path: Path, seed: int) -> Saved | None:
        try:
            return Saved.from_bytes(path.read_bytes(), self._owner(seed))
        except Exception as error:  # a damaged file can raise anything
            self._say(f"{path.name} is damaged ({told(error)}) and is not used")
            return None

    def _generations(self, seed: int) -> list[Path]:
        """Return a seed's checkpoints, oldest first."""
        paths = self._folder.glob(f"seed-{seed}.*.checkpoint")
        return sorted(paths, key=lambda path: int(path.suffixes[-2][1:]))

    def _finished_path(self, seed: int) -> Path:
        return self._folder / f"seed-{seed}.finished"

    def _take(self, lock: TextIO) -> None:
        """Lock a file until it is closed."""
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.seek(0)
            process = lock.read()
            self._say(
                f"waiting for process {process}, which is already training it and will not be "
                f"started again; `kill {process}` stops it with a checkpoint"
            )
            fcntl.flock(lock, fcntl.LOCK_EX)
        lock.truncate(0)
        lock.write(str(os.getpid()))
        lock.flush()

    def _remove_oldest(self, seeds: Iterable[int]) -> None:
        """Remove the oldest files that this training does not need, beyond the size to keep."""
        needed = {self._finished_path(seed) for seed in seeds}
        found = []
        for path in self._agent_folder.glob("*/seed-*"):
            with suppress(FileNotFoundError):  # another training of the agent may have removed it
                found.append((path.stat(), path))
        found.sort(key=lambda pair: pair[0].st_mtime, reverse=True)
        kept = num_removed = 0
        for status, path in found:
            if path not in needed:
                kept += status.st_size
                if kept > KEPT_BYTES:
                    path.unlink(missing_ok=True)
                    num_removed += 1
        if num_removed:
            self._say(
                f"removed {num_removed} checkpoints of other parameters or seeds from "
                f"{self._agent_folder}: {KEPT_BYTES / 2**30:g} GiB of them are kept"
            )
