"""Flipped bytes in every kind of file that the project reads.

Usage: python -m soak.mutations FOLDER [--seed SEED] [--each COUNT]

The folder is a project in which `AGENTS` are trained and one of them is evaluated. A changed file
may still be read, or is refused as bad input; nothing else may happen. Each reading has limits of
time and memory. The counts are printed as JSON.
"""

import argparse
import json
import random
import resource
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

from jumping_ant.agents.imitation.demonstrations import Demonstrations
from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import params_file
from jumping_ant.experiment.models import Params
from jumping_ant.judging import results
from jumping_ant.policies import policy_file
from jumping_ant.showing import rendering
from jumping_ant.sim import robot, trajectory
from jumping_ant.sim.task import Task
from jumping_ant.tracking import records
from jumping_ant.training import driver
from jumping_ant.training.checkpoints import Saved
from scripts.checkout import Checkout
from soak.project import owner_of

AGENTS = ("dqn", "sac", "pgpe")
EVALUATED = "pgpe"
MOST_FLIPS = 8  # in one file
SECONDS = 20
BYTES = 2 * 2**30

Read = Callable[[], object]


@dataclass
class Count:
    """Files changed, those answered as they should be, and what happened to the others."""

    tried: int = 0
    clear: int = 0
    troubles: list[str] = field(default_factory=list)


def main() -> None:
    """Parse the command line, try all readers, and print the counts."""
    parser = argparse.ArgumentParser(prog="python -m soak.mutations")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--each", type=int, default=500, help="changed versions of each file")
    arguments = parser.parse_args()
    generator = random.Random(arguments.seed)
    counts = {}
    for path, read in readers(arguments.folder):
        name = str(path.relative_to(arguments.folder))
        counts[name] = asdict(mutate(path, read, generator, arguments.each))
        print(f"{name}: {counts[name]['clear']} of {counts[name]['tried']}", file=sys.stderr)
    print(json.dumps(counts))


def prepare(project: Checkout) -> None:
    """Train, in this process, and make of it what the readers need."""
    for agent in AGENTS:
        driver.train(project.folder, params_file.load(Paths(project.folder).params), agent)
    stages = (f"evaluate@{EVALUATED}", f"scaling@{EVALUATED}", "demonstrate@imitation")
    project.seconds("dvc", "repro", "--single-item", *stages)


def readers(root: Path) -> Iterator[tuple[Path, Read]]:
    """Yield every kind of file, and what reads it."""
    paths, evaluated = Paths(root), Paths(root).agent(EVALUATED)
    params = params_file.load(paths.params)
    one = params.model_copy(update={"agents": {EVALUATED: params.agent(EVALUATED)}})
    seed = params.seeds[0]
    yield paths.params, partial(params_file.load, paths.params)
    own = root / "robots" / "tripod.xml"
    yield own, partial(_build, root, params, f"robots/{own.name}")
    yield paths.assets / robot.FILES["edited"], partial(_simulate, root, params)
    for agent in AGENTS:
        policy = paths.agent(agent).seed(seed).policy
        yield policy, partial(policy_file.load, policy)
    demonstrations = paths.demonstrations("imitation")
    yield demonstrations, partial(_imitate, demonstrations)
    finished = next((root / ".checkpoints" / EVALUATED).rglob("*.finished"))
    yield finished, partial(_resume, finished)
    yield evaluated.trajectory, partial(_show, evaluated.trajectory)
    for table in (evaluated.seed(seed).curve, evaluated.timing, evaluated.scaling):
        yield table, partial(results.load, root, one)
    for table in (evaluated.episodes, evaluated.variants):
        yield table, partial(results.load, root, one)
    tracked = (evaluated.seed(seed).curve, evaluated.timing, evaluated.seed_means)
    for table in (*tracked, evaluated.variants, evaluated.metrics, paths.physique):
        yield table, partial(_track, root, one)


def mutate(path: Path, read: Read, generator: random.Random, count: int) -> Count:
    """Read changed versions of a file, and put it back."""
    done = Count()
    content = path.read_bytes()
    try:
        for _ in range(count):
            path.unlink()  # DVC may have linked it
            path.write_bytes(_changed(content, generator))
            done.tried += 1
            try:
                with _limited():
                    read()
                done.clear += 1
            except InputError as error:
                is_long = len(str(error)) > 2000
                done.clear += not is_long
                if is_long:
                    done.troubles.append(f"{len(str(error))} characters: {str(error)[:200]}")
            except BaseException as error:  # whatever it is, it is no clear line
                done.troubles.append(f"{type(error).__name__}: {str(error)[:200]}")
    finally:
        path.write_bytes(content)
    return done


def _changed(content: bytes, generator: random.Random) -> bytes:
    """Flip some bytes, cut the file, or repeat a part of it."""
    changed = bytearray(content)
    kind = generator.random()
    if kind < 0.1:
        return bytes(changed[: generator.randrange(len(changed))])
    if kind < 0.2:
        first, last = sorted(generator.randrange(len(changed)) for _ in range(2))
        return bytes(changed[:last] + changed[first:])
    for _ in range(generator.randint(1, MOST_FLIPS)):
        changed[generator.randrange(len(changed))] = generator.randrange(256)
    return bytes(changed)


@contextmanager
def _limited() -> Iterator[None]:
    """End what takes too long, or too much memory."""

    def stop(number: int, frame: object) -> None:
        raise TimeoutError(f"still reading after {SECONDS} s")

    pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[0])
    before = resource.getrlimit(resource.RLIMIT_AS)
    limit = pages * resource.getpagesize() + BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, before[1]))
    signal.signal(signal.SIGALRM, stop)
    signal.alarm(SECONDS)
    try:
        yield
    finally:
        signal.alarm(0)
        resource.setrlimit(resource.RLIMIT_AS, before)


def _build(root: Path, params: Params, source: str) -> None:
    """Build a robot of the project, as it comes."""
    unset = {name: None for name, value in params.robot if isinstance(value, float)}
    changes = {"source": source, "joint_gear": {}, "edits": {}}
    robot.load(robot.build(params.robot.model_copy(update=unset | changes), root))


def _simulate(root: Path, params: Params) -> None:
    xml = robot.read(root)
    Task(robot.load(xml), params.env)
    rendering.scene(xml, 0)


def _imitate(path: Path) -> None:
    """Read demonstrations as a trainer does."""
    policy_file.parse(Demonstrations.from_bytes(path.read_bytes()).expert)


def _resume(path: Path) -> None:
    try:
        Saved.from_bytes(path.read_bytes(), owner_of(path))
    except ValueError as error:  # what is damaged is told, and not used
        raise InputError(str(error)) from error


def _show(path: Path) -> None:
    trajectory.load(path).rows(1, 10.0)


def _track(root: Path, params: Params) -> None:
    comparison = records.read(root, params)
    for record in comparison.seeds:
        record.describe(None)
        _ = (record.curve, record.summary, record.artifacts)  # read when they are asked for


if __name__ == "__main__":
    main()
