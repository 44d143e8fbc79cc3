"""Checkpoints of an agent's seeds on disk, to resume from after a kill.

The folder `.checkpoints/<agent>/<key>/` lies outside of what DVC deletes: outputs before a stage
runs, and folders of experiments afterwards. The key is a digest of everything that a seed's results
depend on, so a checkpoint of anything else is never resumed from. The folder contains:

| file | content |
|---|---|
| seed-N.M.checkpoint | seed N at its M-th checkpoint; the last two are kept |
| seed-N.finished | seed N, finished |

Every file is complete or absent (see `jumping_ant.base.files`), begins with a digest of its agent,
key, seed and content, and holds numbers and text: nothing in it is executed.

Finished seeds are kept, so that a training with more seeds trains only the new ones. Files of other
keys are kept, too, for a return to earlier parameters; beyond `KEPT_BYTES`, the oldest ones go.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import Annotated, Any

from filelock import Timeout
from pydantic import BaseModel, ConfigDict, Field

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.training_code import training_code
from jumping_ant.base import effective_code, locks, machine, process
from jumping_ant.base.archive import Archive, pack
from jumping_ant.base.errors import told
from jumping_ant.base.files import content, write_bytes
from jumping_ant.base.paths import home
from jumping_ant.params.blocks import TrainingParams
from jumping_ant.sim.world import World
from jumping_ant.training.model_selection import Candidate, Candidates

DRIVER = Path(__file__).with_name("driver.py")
GENERATIONS = 2
KEPT_BYTES = 2 * 2**30  # for an agent, of other parameters and of seeds that are not trained now
_HEADER, _CONTENT = "header.json", "content"


def checkpoint_key(
    world: World, training: TrainingParams, agent: AgentBlock, demonstrations: bytes | None = None
) -> str:
    """Return a digest of everything that the output files of an agent's seeds depend on."""
    content = {
        "robot": world.xml,
        "params": [block.model_dump() for block in (world.env, training, agent)],
        "code": list(map(effective_code.read, sorted(training_code(agent.algorithm, DRIVER)))),
        "machine": machine.describe(),
    }
    if demonstrations is not None:
        content["demonstrations"] = hashlib.sha256(demonstrations).hexdigest()
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]


def owner_of(path: Path) -> str:
    """Return which agent, key and seed a file is of, by its place."""
    return "/".join([*path.parts[-3:-1], path.name.partition(".")[0]])


Steps = Annotated[int, Field(ge=0, le=10**15, strict=True)]
Seconds = Annotated[float, Field(ge=0, le=1e12, strict=True)]
Return = Annotated[float, Field(ge=-1e15, le=1e15, strict=True)]


class _Header(BaseModel):
    """What a file says beside its policies."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    env_steps: Steps
    seconds: Seconds
    timing: list[tuple[Steps, Seconds]]
    machine: dict[str, Any] | None
    curve: str
    candidates: list[tuple[Steps, Annotated[list[Return], Field(min_length=1)]]]


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

    def to_bytes(self, owner: str) -> bytes:
        """Return the content of the owner's file."""
        header = vars(self) | {"candidates": [(it.env_steps, it.returns) for it in self.candidates]}
        entries = {_policy(rank): it.policy for rank, it in enumerate(self.candidates)}
        entries[_CONTENT] = header.pop("content")
        packed = pack({_HEADER: json.dumps(header).encode(), **entries})
        return _digest(owner, packed) + b"\n" + packed

    @classmethod
    def from_bytes(cls, file: bytes, owner: str) -> "Saved":
        """Read the owner's file; a damaged one or another owner's raises a ValueError."""
        digest, _, packed = file.partition(b"\n")
        if _digest(owner, packed) != digest:
            raise ValueError("the digest does not match")
        entries = Archive(packed)
        header = _Header.model_validate(entries.json(_HEADER))
        json.dumps(header.machine, allow_nan=False)
        candidates = tuple(
            Candidate(env_steps, tuple(returns), entries[_policy(rank)])
            for rank, (env_steps, returns) in enumerate(header.candidates)
        )
        return cls(content=entries[_CONTENT], **{**dict(header), "candidates": candidates})


def _policy(rank: int) -> str:
    return f"candidate-{rank}"


def _digest(owner: str, packed: bytes) -> bytes:
    digest = hashlib.sha256(owner.encode())
    digest.update(packed)
    return digest.hexdigest().encode()


class Checkpoints:
    """The checkpoints of an agent's seeds; `key` is the digest of what their results depend on."""

    def __init__(self, root: Path, agent: str, key: str, say: Callable[[str], None]) -> None:
        self._root, self._workspace = root, root / ".checkpoints" / agent
        self._agent_folder = home(root) / ".checkpoints" / agent
        self._folder = self._agent_folder / key
        self._say = say

    @contextmanager
    def opened(self, seeds: Iterable[int]) -> Iterator[None]:
        """Lock the agent while it trains, and clean up if training finishes.

        Another process may be training it, such as one whose `dvc repro` was killed: wait for it.
        """
        with self._locked(self._workspace), self._locked(self._folder):
            yield
            self._remove_oldest(seeds)

    def load(self, seed: int) -> Saved | None:
        """Return a seed's newest undamaged checkpoint, if any; remove newer, damaged ones."""
        for path in reversed(self._generations(seed)):
            if saved := self._read(path):
                return saved
            path.unlink()
        return None

    def finished(self, seed: int) -> Saved | None:
        """Return a seed that is already trained, None if it is not."""
        path = self._finished_path(seed)
        return self._read(path, is_finished=True) if path.exists() else None

    def save(self, seed: int, saved: Saved) -> None:
        """Write a seed's next checkpoint; older ones stay if that fails, as on a full disk."""
        old = self._generations(seed)
        number = int(old[-1].suffixes[-2][1:]) + 1 if old else 1
        path = self._folder / f"seed-{seed}.{number}.checkpoint"
        write_bytes(path, saved.to_bytes(owner_of(path)))
        for path in old[: 1 - GENERATIONS]:
            path.unlink()

    def finish(self, seed: int, saved: Saved) -> None:
        """Write a trained seed, then remove its checkpoints; they stay if writing fails."""
        path = self._finished_path(seed)
        write_bytes(path, saved.to_bytes(owner_of(path)))
        for path in self._generations(seed):
            path.unlink()

    def _read(self, path: Path, is_finished: bool = False) -> Saved | None:
        try:
            saved = Saved.from_bytes(content(path), owner_of(path))
            if is_finished and not saved.candidates:
                raise ValueError("no candidate to publish")
            return saved
        except Exception as error:  # a damaged file can raise anything
            self._say(f"{path.name} is damaged ({told(error)}) and is not used")
            return None

    def _generations(self, seed: int) -> list[Path]:
        """Return a seed's checkpoints, oldest first."""
        paths = self._folder.glob(f"seed-{seed}.[1-9]*.checkpoint")
        return sorted(paths, key=lambda path: int(path.suffixes[-2][1:]))

    def _finished_path(self, seed: int) -> Path:
        return self._folder / f"seed-{seed}.finished"

    def _locked(self, folder: Path) -> AbstractContextManager[object]:
        """Lock a folder, and note in the lock's file which process has it."""
        path = folder / "lock"
        lock = locks.lock(path, self._root)
        try:
            held = lock.acquire(blocking=False)
        except Timeout:
            number = process.running(path.read_text(encoding="utf-8"))
            name = f"process {number}" if number else "another process"
            advice = f"; `kill {number}` stops it with a checkpoint" if number else ""
            self._say(f"waiting for {name}, which is already training it{advice}")
            held = lock.acquire()
        path.write_text(process.this_process(), encoding="utf-8")
        return held

    def _remove_oldest(self, seeds: Iterable[int]) -> None:
        needed = {self._finished_path(seed) for seed in seeds}
        others = []
        for path in set(self._agent_folder.glob("*/seed-*")) - needed:
            with suppress(FileNotFoundError):  # another training of the agent may have removed it
                others.append((path.stat(), path))
        others.sort(key=lambda pair: pair[0].st_mtime, reverse=True)
        sizes = accumulate(status.st_size for status, _ in others)
        removed = [path for (_, path), size in zip(others, sizes, strict=True) if size > KEPT_BYTES]
        for path in removed:
            path.unlink(missing_ok=True)
        if removed:
            kept = f"{KEPT_BYTES / 2**30:g} GiB of other parameters or seeds are kept"
            self._say(f"removed {len(removed)} checkpoints from {self._agent_folder}: {kept}")
