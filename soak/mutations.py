"""Flipped bytes, and code, in every kind of file that the project reads.

Usage: python -m soak.mutations FOLDER SEED COUNT

The folder is the project that this process runs from, in which `AGENTS` are trained. Of each file
there are so many changed versions: it may be read, or refused as bad input; nothing else may
happen. The stage `compare` draws fewer changed tables. Each reading has limits of time and memory.
The figures are printed as JSON.
"""

import importlib
import itertools
import json
import random
import resource
import signal
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import psutil  # type: ignore[import-untyped]

from jumping_ant.agents.imitation.demonstrations import Demonstrations
from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.media import rendering
from jumping_ant.params import params_file
from jumping_ant.params.model import Params
from jumping_ant.policies import policy_file
from jumping_ant.sim import robot, trajectory
from jumping_ant.sim.task import Task
from jumping_ant.sim.world import World
from jumping_ant.tracking import records
from jumping_ant.training import driver
from jumping_ant.training.checkpoints import Saved, owner_of
from scripts.checkout import Checkout
from soak import payloads
from soak.project import Count

AGENTS = ("dqn", "sac", "pgpe")
EVALUATED = "pgpe"
MOST_FLIPS = 8  # in one file
FEWER = 15  # times as few of those that stages draw, which takes seconds
EXTREMES = ("", "0", "-1", "1e-30", "1e+30", "-1e+308")  # of a table's cells
SECONDS = 300  # drawing takes 5 to 15, and many times as long where tests fill the cores
BYTES = 2 * 2**30

Read = Callable[[], object]


def main() -> None:
    """Try all readers with changed files, and print the figures."""
    root, seed, each = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    generator = random.Random(seed)
    for stage, agent in itertools.product(("evaluate", "robustness"), AGENTS):
        run_stage(stage, agent)
    run_stage("compare")
    counts: dict[str, Count] = {}
    planted = {"planted": 0, "executed": 0}
    troubles: list[str] = []

    def read_changed(path: Path, read: Read, changes: Iterable[bytes]) -> None:
        """Read changed versions of a file, and put it back."""
        name, content = str(path.relative_to(root)), path.read_bytes()
        print(name, file=sys.stderr)
        count = counts.setdefault(name, {"tried": 0, "clear": 0})
        for changed in changes:
            path.unlink()  # DVC may have linked it
            path.write_bytes(changed)
            trouble = _trouble(read)
            count["tried"] += 1
            count["clear"] += not trouble
            troubles.extend([f"{name}: {trouble}"] if trouble else [])
        path.unlink()
        path.write_bytes(content)

    with tempfile.TemporaryDirectory() as folder:
        for path, read in readers(root):
            read_changed(path, read, flips(path.read_bytes(), generator, each))
            payloads.plant(path, read, Path(folder) / "executed", planted)
    few = each // FEWER
    # Most of the others are changed by tests/comparison/test_tables.py, without drawing.
    for path in drawn(root)[: None if few else 1]:
        content = path.read_bytes()
        others = extremes(content, generator, max(1, few))
        changes = itertools.chain(flips(content, generator, few), others)
        read_changed(path, partial(run_stage, "compare"), changes)
    troubles += ["code ran"] * planted["executed"]
    print(json.dumps({"mutations": counts, "payloads": planted, "troubles": troubles}))


def run_stage(stage: str, *arguments: str) -> None:
    """Run a stage in this process."""
    sys.argv = [stage, *arguments]
    importlib.import_module(f"stages.{stage}").main()


def prepare(project: Checkout) -> None:
    """Train, in this process, and make of it what the readers need."""
    for agent in AGENTS:
        driver.train(project.folder, params_file.load(Paths(project.folder).params), agent)
    project.seconds("dvc", "repro", "--single-item", "demonstrate@bc")


def readers(root: Path) -> Iterator[tuple[Path, Read]]:
    """Yield every kind of file, and what reads it."""
    paths, evaluated = Paths(root), Paths(root).agent(EVALUATED)
    params = params_file.load(paths.params)
    one = params.model_copy(update={"agents": {EVALUATED: params.agent(EVALUATED)}})
    seed = params.seeds[0]
    yield paths.params, partial(params_file.load, paths.params)
    yield root / "robots" / "tripod.xml", partial(_build, root, params, "robots/tripod.xml")
    yield paths.assets / robot.FILES["edited"], partial(_simulate, root, params)
    for agent in AGENTS:
        policy = paths.agent(agent).seed(seed).policy
        yield policy, partial(policy_file.load, policy)
    demonstrations = paths.demonstrations("bc")
    yield demonstrations, partial(_imitate, demonstrations)
    finished = next((root / ".checkpoints" / EVALUATED).rglob("*.finished"))
    yield finished, partial(_resume, finished)
    yield evaluated.trajectory, partial(_show, evaluated.trajectory)
    trained = evaluated.seed(seed)
    tracked = (trained.curve, trained.validation, evaluated.timing, evaluated.seed_means)
    for table in (*tracked, evaluated.variants, paths.physique):
        yield table, partial(_track, root, one)


def drawn(root: Path) -> list[Path]:
    """Return every kind of table that the comparison's statistics are made of."""
    evaluated = Paths(root).agent(EVALUATED)
    curve = evaluated.seed(params_file.load(Paths(root).params).seeds[0]).curve
    return [curve, evaluated.episodes, evaluated.variants, Paths(root).perturbed(EVALUATED)]


def _trouble(read: Read) -> str:
    """Return what is wrong with how a changed file is read, nothing if it is as it should be."""
    try:
        with _limited():
            read()
    except InputError as error:
        # Of params.yaml, there is a line for each fault.
        lines = {line.partition(":")[0] for line in str(error).splitlines()}
        is_clear = len(str(error)) < 2000 and len(lines) == 1
        return "" if is_clear else f"{len(str(error))} characters: {str(error)[:200]!r}"
    except BaseException as error:  # whatever it is, it is no clear line
        return f"{type(error).__name__}: {str(error)[:200]}"
    return ""


def flips(content: bytes, generator: random.Random, count: int) -> Iterator[bytes]:
    """Yield versions of a file with some bytes changed, cut, or with a part repeated."""
    for _ in range(count):
        changed = bytearray(content)
        kind = generator.random()
        if kind < 0.1:
            del changed[generator.randrange(len(changed)) :]
        elif kind < 0.2:
            first, last = sorted(generator.randrange(len(changed)) for _ in range(2))
            changed = changed[:last] + changed[first:]
        else:
            for _ in range(generator.randint(1, MOST_FLIPS)):
                changed[generator.randrange(len(changed))] = generator.randrange(256)
        yield bytes(changed)


def extremes(content: bytes, generator: random.Random, most: int) -> Iterator[bytes]:
    """Yield versions of a table with an extreme number in a cell, another number in each."""
    for cell in generator.sample(EXTREMES, min(most, len(EXTREMES))):
        rows = [line.split(b",") for line in content.splitlines()]
        row = generator.choice(rows[1:])
        row[generator.randrange(len(row))] = cell.encode()
        yield b"".join(b",".join(row) + b"\n" for row in rows)


@contextmanager
def _limited() -> Iterator[None]:
    """End what takes too long, or too much memory."""

    def stop(number: int, frame: object) -> None:
        raise TimeoutError(f"still reading after {SECONDS} s")

    before = resource.getrlimit(resource.RLIMIT_AS)
    limit = psutil.Process().memory_info().vms + BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, before[1]))
    signal.signal(signal.SIGALRM, stop)
    signal.alarm(SECONDS)
    try:
        yield
    finally:
        signal.alarm(0)
        resource.setrlimit(resource.RLIMIT_AS, before)


def _build(root: Path, params: Params, source: str) -> None:
    unset = {name: None for name, value in params.robot if isinstance(value, float)}
    changes = {"source": source, "joint_gear": {}, "edits": {}}
    robot.load(robot.build(params.robot.model_copy(update=unset | changes), root))


def _simulate(root: Path, params: Params) -> None:
    xml = robot.read(root)
    Task(World(xml, params.env))
    rendering.scene(xml, 0)


def _imitate(path: Path) -> None:
    policy_file.parse(Demonstrations.from_bytes(path.read_bytes()).expert)


def _resume(path: Path) -> None:
    try:
        saved = Saved.from_bytes(path.read_bytes(), owner_of(path))
        policy_file.parse(saved.content)
    except ValueError as error:  # a damaged checkpoint is not used
        raise InputError(str(error)) from error


def _show(path: Path) -> None:
    trajectory.load(path).rows(1, 10.0)


def _track(root: Path, params: Params) -> None:
    comparison = records.read(root, params)
    for record in comparison.seeds:
        record.describe()
        _ = (record.curve, record.summary, record.artifacts)  # read when they are asked for


if __name__ == "__main__":
    main()
