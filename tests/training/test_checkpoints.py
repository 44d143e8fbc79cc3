import fcntl
import hashlib
import json
import math
import os
import shutil
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from jumping_ant.base import process
from jumping_ant.base.archive import Archive, pack
from jumping_ant.training import checkpoints
from jumping_ant.training.checkpoints import Checkpoints, Saved
from jumping_ant.training.model_selection import Candidate

SAVED = Saved(
    env_steps=100,
    seconds=1.5,
    timing=[(50, 0.75), (100, 1.5)],
    machine=None,
    curve="env_steps\n50\n100\n",
    candidates=(Candidate(100, (12.5, 0.1), b"best so far"), Candidate(50, (6.0, 0.0), b"other")),
    content=bytes(range(256)),
)
DAMAGED = " is damaged (ValueError: the digest does not match) and is not used"
POLICY = replace(SAVED, machine={"cpu": "a"}, content=b"policy")


@pytest.fixture
def said() -> list[str]:
    return []


def store(root: Path, said: list[str], key: str = "key", agent: str = "sac") -> Checkpoints:
    return Checkpoints(root, agent, key, said.append)


def files(root: Path) -> list[str]:
    folder = root / ".checkpoints"
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def test_the_last_two_are_kept_and_the_newest_is_loaded(tmp_path: Path, said: list[str]) -> None:
    stored = store(tmp_path, said)
    assert stored.load(0) is None
    for steps in range(100, 1300, 100):
        stored.save(0, replace(SAVED, env_steps=steps))
    stored.save(1, replace(SAVED, candidates=()))
    assert store(tmp_path, said).load(0) == replace(SAVED, env_steps=1200)
    assert stored.load(1) == replace(SAVED, candidates=())
    numbers = ("0.11", "0.12", "1.1")
    assert files(tmp_path) == [f"sac/key/seed-{number}.checkpoint" for number in numbers]
    assert said == []


WHOLE = SAVED.to_bytes("sac/key/seed-0")
OTHERS = ("sac/key/seed-1", "sac/other/seed-0", "dqn/key/seed-0")


@pytest.mark.parametrize(
    "damage",
    [WHOLE[:-99], WHOLE[:-99] + b"?" + WHOLE[-98:], b"not one", *map(SAVED.to_bytes, OTHERS)],
    ids=["torn", "changed", "foreign", *OTHERS],
)
def test_a_damaged_one_gives_way_to_the_one_before(
    tmp_path: Path, said: list[str], damage: bytes
) -> None:
    folder = tmp_path / ".checkpoints" / "sac" / "key"
    stored = store(tmp_path, said)
    for steps in (100, 200):
        stored.save(0, replace(SAVED, env_steps=steps))
    (folder / "seed-0.2.checkpoint").write_bytes(damage)
    assert stored.load(0) == SAVED
    assert said == [f"seed-0.2.checkpoint{DAMAGED}"]
    stored.save(0, replace(SAVED, env_steps=300))
    assert store(tmp_path, said).load(0).env_steps == 300
    assert files(tmp_path) == ["sac/key/seed-0.1.checkpoint", "sac/key/seed-0.2.checkpoint"]
    for path in folder.glob("seed-0.*"):
        path.write_bytes(damage)
    assert stored.load(0) is None


def test_a_finished_seed_needs_no_checkpoint(tmp_path: Path, said: list[str]) -> None:
    stored = store(tmp_path, said)
    stored.save(0, SAVED)
    assert stored.finished(0) is None
    stored.finish(0, POLICY)
    assert stored.finished(0) == POLICY and stored.load(0) is None
    assert files(tmp_path) == ["sac/key/seed-0.finished"]
    (tmp_path / ".checkpoints/sac/key/seed-0.finished").write_bytes(b"torn")
    assert stored.finished(0) is None
    assert said == [f"seed-0.finished{DAMAGED}"]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("env_steps", value) for value in ("x", 1.5, -1, True, None, [])),
        *(("seconds", value) for value in ("x", -1.0, None, math.inf)),
        ("env_steps", 10**30),
        ("machine", {"x": math.nan}),
        ("candidates", [[1, [math.nan]]]),
        *(("timing", value) for value in ("x", [["1", "2"]], [[1]], [1, 2], {})),
        *(("machine", value) for value in ("x", [1])),
        *(("curve", value) for value in (1, None, ["a"])),
        *(("candidates", value) for value in ([], [[1, ["x"]]], [[1, []]], [[1]], "x", None)),
        ("more", 1),
    ],
)
def test_a_finished_seed_of_other_types_is_not_used(
    tmp_path: Path, said: list[str], name: str, value: Any
) -> None:
    """With a digest that is right, as whoever may write there can make it."""
    stored, owner = store(tmp_path, said), "sac/key/seed-0"
    stored.finish(0, POLICY)
    path = tmp_path / ".checkpoints" / f"{owner}.finished"
    entries = dict(Archive(path.read_bytes().partition(b"\n")[2]))
    header = json.loads(entries["header.json"]) | {name: value}
    packed = pack(entries | {"header.json": json.dumps(header).encode()})
    digest = hashlib.sha256(owner.encode() + packed).hexdigest()
    path.write_bytes(digest.encode() + b"\n" + packed)
    assert stored.finished(0) is None
    assert len(said) == 1 and said[0].startswith("seed-0.finished is damaged (")


def train(root: Path, said: list[str], seeds: list[int], key: str = "key") -> list[int]:
    """Train to the end; return the seeds that were not there yet."""
    stored = store(root, said, key)
    with stored.opened(seeds):
        missing = [seed for seed in seeds if not stored.finished(seed)]
        for seed in missing:
            stored.save(seed, SAVED)
            stored.finish(seed, POLICY)
    return missing


def test_what_was_trained_is_kept(tmp_path: Path, said: list[str]) -> None:
    """Whatever was trained in between: other seeds, other parameters."""
    assert train(tmp_path, said, [0, 1]) == [0, 1]
    assert train(tmp_path, said, [0, 1, 2]) == [2]
    assert train(tmp_path, said, [2, 0], key="other") == [2, 0]
    store(tmp_path, said, "third").save(7, SAVED)
    assert train(tmp_path, said, [1, 2, 0]) == []
    assert store(tmp_path, said, "third").load(7) == SAVED
    assert said == []


def test_the_oldest_ones_are_removed_beyond_a_size(
    tmp_path: Path, said: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    train(tmp_path, said, [0, 1])
    store(tmp_path, said, "half").save(0, SAVED)
    size = len(POLICY.to_bytes("sac/other/seed-0"))
    monkeypatch.setattr(checkpoints, "KEPT_BYTES", 3.5 * size)
    folder = tmp_path / ".checkpoints" / "sac"
    for age, path in enumerate(("half/seed-0.1.checkpoint", "key/seed-1.finished")):
        os.utime(folder / path, (1000 - age, 1000 - age))
    train(tmp_path, said, [0, 1], key="other")
    assert said == []
    train(tmp_path, said, [0, 1], key="third")
    assert train(tmp_path, said, [0, 1], key="other") == []
    assert [path for path in files(tmp_path) if "seed" in path] == [
        "sac/key/seed-0.finished",
        *(f"sac/{key}/seed-{seed}.finished" for key in ("other", "third") for seed in (0, 1)),
    ]
    (line,) = said
    assert line.startswith("removed 2 checkpoints from ")


def test_experiments_in_other_folders_share_them(tmp_path: Path, said: list[str]) -> None:
    """`dvc exp run --temp` and `--queue` work in folders that DVC deletes afterwards."""
    folder = tmp_path / ".dvc" / "tmp" / "exps" / "standalone" / "tmpxyz"
    train(folder, said, [0])
    shutil.rmtree(folder)
    assert train(tmp_path, said, [0]) == []
    another = tmp_path / ".dvc" / "tmp" / "exps" / "tmp2"
    with store(another, said).opened([0]), store(tmp_path, said, "other").opened([0]):
        assert said == [], "trainings in two folders, of two sets of parameters"


def test_one_process_at_a_time(tmp_path: Path, said: list[str]) -> None:
    """What one reaches while another waits is the other's, and not trained anew."""
    program = (
        "import sys, pathlib; from jumping_ant.training.checkpoints import Checkpoints, Saved\n"
        "from jumping_ant.training.model_selection import Candidate\n"
        "checkpoints = Checkpoints(pathlib.Path(sys.argv[1]), 'sac', 'key', print)\n"
        "with checkpoints.opened([0]):\n"
        "    print('open', flush=True); sys.stdin.read()\n"
        "    one = Candidate(1, (0.0,), b'policy')\n"
        "    checkpoints.finish(0, Saved(1, 0.0, [], None, '', (one,), b'policy'))"
    )
    pipe = subprocess.PIPE
    command = [sys.executable, "-c", program, str(tmp_path)]
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, encoding="utf-8") as other:
        assert other.stdout.readline() == "open\n"
        threading.Timer(0.5, other.stdin.close).start()
        with store(tmp_path, said).opened([0]):
            assert other.wait() == 0
            assert store(tmp_path, said).finished(0).content == b"policy"
    assert said == [
        f"waiting for process {other.pid}, which is already training it; "
        f"`kill {other.pid}` stops it with a checkpoint"
    ]


@pytest.mark.parametrize("who", ["ended", "a stranger's"])
def test_no_process_is_named_that_is_not_ours(tmp_path: Path, said: list[str], who: str) -> None:
    """Process 1 is another user's, or that of the container; advice to kill it would be bad."""
    folder = tmp_path / ".checkpoints" / "sac"
    folder.mkdir(parents=True)
    with (folder / "lock").open("w", encoding="utf-8") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        print(process.name_of(1) if who != "ended" else process.this_process() + "0", file=other)
        other.flush()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("os.getuid", lambda: 12345)
            threading.Timer(0.3, fcntl.flock, [other, fcntl.LOCK_UN]).start()
            with store(tmp_path, said).opened([0]):
                pass
    assert said == ["waiting for another process, which is already training it"]
