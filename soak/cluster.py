"""Train on a cluster of hosts of one's own, kill some, and write figures to results/cluster.json.

Usage: python -m soak.cluster [PART...] [--seed SEED] (takes root, and ten minutes)

A head, two workers of one core and the desk that submits are hosts of their own (see `soak.hosts`):
no disk is shared, Ray asks for a token, and its runtime environment brings the code. The same
trainings run inline, on the cluster, with a worker that is killed in the middle, and with a head
that is killed in the middle; all must write the same bytes. So must the stages that play episodes
of the trained policies, inline and on the cluster. A worker that has a package in another version
must be refused before it trains. One seed's population plays on one to three workers, is timed (see
`soak.population`), and loses a worker.
"""

import json
import random
import secrets
import subprocess
import sys
import tempfile
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jumping_ant.base import command_line, files
from jumping_ant.base.files import PROJECT_ROOT, write_json, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import params_file
from jumping_ant.experiment.models import Params
from scripts import publish
from scripts.checkout import Checkout, checkout
from soak import hosts, population
from soak import project as projects
from soak.generations import POPULATIONS
from soak.hosts import Host
from soak.project import LEARNERS

PATH = PROJECT_ROOT / "results" / "cluster.json"
PAGE = PROJECT_ROOT / "docs" / "cluster.md"
PARTS = ("undisturbed", "worker killed", "head killed", "worker unlike", "population")
HEAD, DESK, WORKERS = "head", "desk", ("one", "two")
MORE_WORKERS = (*WORKERS, "three")  # for a population
TRAIN, PLAYS = ("train",), ("evaluate", "robustness")  # stages that use the cluster
DISTURBED = "sac"  # the agent in whose training a worker is killed
BUDGETS = {
    "dqn": {"total_steps": 8_000},
    "sac": {"total_steps": 2_000},
    "pgpe": {"generations": 16},
}
SHARED = {"pgpe": {"generations": 60, "population_size": 20}}
LONG = {"dqn": {"total_steps": 40_000}}  # without a head, workers train on for a while
OTHER = ("evotorch", "0.0.1")  # a package, and a version that is not the locked one
PORT = 6379
STORE_BYTES = 100 * 2**20
SECONDS_TO_JOIN = 120.0
SECONDS_FOR_TRAINING = 900.0

Figures = dict[str, Any]


def main() -> None:
    """Parse the command line, run, and exit with 1 if anything went wrong."""
    parser = command_line.parser(__doc__, "python -m soak.cluster")
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    parts = arguments.parts or PARTS
    if unknown := set(parts) - set(PARTS):
        parser.error(f"given {sorted(unknown)}, allowed: {', '.join(PARTS)}")
    if reason := hosts.missing():
        parser.error(reason)
    troubles: list[str] = []
    with checkout() as project:
        projects.prepare(project)
        figures = run(project, parts, random.Random(arguments.seed), troubles)
    if arguments.parts and PATH.exists():
        figures = json.loads(PATH.read_text(encoding="utf-8")) | figures
    write_json(PATH, figures)
    if "population" in parts:
        section = population.table(figures["population"])
        publish.replace_section(PAGE, "population", section)
    print(json.dumps(figures, indent=2))
    print("\n".join(troubles))
    raise SystemExit(bool(troubles))


def run(
    project: Checkout, parts: Collection[str], generator: random.Random, troubles: list[str]
) -> Figures:
    """Return the figures of all parts; add what is wrong to the troubles."""
    figures: Figures = {"hosts": 2 + len(WORKERS)}
    if "undisturbed" in parts:
        expected, seconds = inline(project, LEARNERS, BUDGETS)
        played, seconds_to_play = inline(project, LEARNERS, BUDGETS, PLAYS)
        figures |= {"trainings": len(expected), "inline": {"seconds": seconds}}
        figures["played"] = {"files": len(played), "inline": {"seconds": seconds_to_play}}
        with cluster(project, WORKERS) as own:
            figures["undisturbed"] = own.repeated(TRAIN, expected, troubles)
            figures["played"] |= own.repeated(PLAYS, played, troubles)
    if "worker killed" in parts:
        expected, _ = inline(project, [DISTURBED], BUDGETS)
        with cluster(project, WORKERS) as own:
            figures["worker killed"] = own.survived(expected, troubles, generator)
    if "head killed" in parts:
        expected, _ = inline(project, LONG.keys(), LONG)
        with cluster(project, WORKERS) as own:
            figures["head killed"] = own.lost(expected, troubles, generator)
    if "worker unlike" in parts:
        with tempfile.TemporaryDirectory() as folder:
            package = Path(folder) / f"{OTHER[0]}-{OTHER[1]}.dist-info"
            write_text(package / "METADATA", "Name: {}\nVersion: {}\n".format(*OTHER))
            with cluster(project, WORKERS, unlike=Path(folder)) as own:
                figures["worker unlike"] = own.refused(troubles)
    if "population" in parts:
        figures["population"] = _population(project, generator, troubles)
    return figures


def _population(project: Checkout, generator: random.Random, troubles: list[str]) -> Figures:
    """Time one seed's population on more and more hosts, and kill one of two."""
    measured: list[population.Measured] = []
    for count in range(1, 1 + len(MORE_WORKERS)):
        with cluster(project, MORE_WORKERS[:count]) as own:
            rounds, found = own.played()
        measured += found
    for size in POPULATIONS:
        if len({found.policy for found in measured if found.population == size}) > 1:
            troubles.append(f"a population of {size} evolves otherwise on other hosts")
    ones = [population.alone(project.folder, size) for size in POPULATIONS]
    crowding = population.crowding(project.folder)
    figures = population.figures(population.fitted(rounds, ones, measured, crowding), measured)
    expected, _ = inline(project, SHARED.keys(), SHARED, seeds=[0])
    with cluster(project, WORKERS) as own:
        return figures | {"worker killed": own.shrunk(expected, troubles, generator)}


def inline(
    project: Checkout,
    agents: Collection[str],
    budgets: Mapping[str, Mapping[str, int]],
    stages: Sequence[str] = TRAIN,
    seeds: Sequence[int] = projects.SEEDS,
) -> tuple[dict[str, str], float]:
    """Run stages in one process, and leave parameters with which a cluster does the same.

    Returns:
        The digests of what they write, and the seconds.
    """
    project.write_params(settings(budgets, workers=1, seeds=seeds))
    seconds = project.seconds("dvc", "repro", *targets(agents, stages))
    project.write_params(settings(budgets, workers=0, seeds=seeds))
    return digests(project, agents, stages), round(seconds, 1)


def settings(
    budgets: Mapping[str, Mapping[str, int]], workers: int, seeds: Sequence[int]
) -> Params:
    """Return parameters of trainings that last for some checkpoints."""
    content = projects.settings(workers=workers).model_dump() | {"seeds": list(seeds)}
    for agent, budget in budgets.items():
        content["agents"][agent] |= budget
    return params_file.check(content)


def targets(agents: Collection[str], stages: Sequence[str] = TRAIN) -> list[str]:
    """Return stages of agents."""
    return [f"{stage}@{agent}" for stage in stages for agent in agents]


def digests(
    project: Checkout, agents: Collection[str], stages: Sequence[str] = TRAIN
) -> dict[str, str]:
    """Return the digests of what stages write: by agent and seed, or by agent and file."""
    found: dict[str, str] = {}
    for agent in agents:
        paths = Paths(project.folder).agent(agent)
        if stages == TRAIN:
            trained = json.loads(paths.training.read_text(encoding="utf-8"))
            found |= {f"{agent} {seed}": json.dumps(own) for seed, own in trained.items()}
        else:
            written = {*paths.training.parent.glob("[!.]*")} - {paths.training}
            written.add(Paths(project.folder).perturbed(agent))
            found |= {f"{agent} {path.name}": files.digest(path) for path in written}
    return found


@dataclass
class Cluster:
    """A Ray cluster, and a project on the desk that uses it.

    Attributes:
        project: The project.
        desk: The host that it is on.
        head: The host of Ray's head.
        workers: The hosts that train.
        variables: What names the cluster, and its token.
    """

    project: Checkout
    desk: Host
    head: Host
    workers: Sequence[Host]
    variables: dict[str, str]

    def run(
        self, agents: Collection[str], stages: Sequence[str] = TRAIN
    ) -> "subprocess.Popen[bytes]":
        """Start stages of agents from nothing, on the cluster."""
        return self._start("dvc", "repro", "--force", "--single-item", *targets(agents, stages))

    def repeated(
        self, stages: Sequence[str], expected: dict[str, str], troubles: list[str]
    ) -> Figures:
        """Run stages of all learners."""
        before, started = self._moved(), time.monotonic()
        status = self.run(LEARNERS, stages).wait(SECONDS_FOR_TRAINING)
        seconds = time.monotonic() - started
        figures = self._judged(expected, troubles, "undisturbed", status, stages)
        return figures | {"seconds": round(seconds, 1), "bytes_moved": self._moved() - before}

    def survived(
        self, expected: dict[str, str], troubles: list[str], generator: random.Random
    ) -> Figures:
        """Kill a worker in the middle; see that its seed is trained elsewhere."""
        process = self.run([DISTURBED])
        self._await_middle(process, generator, DISTURBED)
        self.workers[-1].kill()
        status = process.wait(SECONDS_FOR_TRAINING)
        told = self.desk.log.read_text(encoding="utf-8")
        taken_over = told.count("and another takes over")
        if not taken_over:
            troubles.append(f"a worker was killed, and nothing was taken over:\n{told}")
        figures = {"killed": 1, "taken_over": taken_over}
        return figures | self._judged(expected, troubles, "a worker killed", status)

    def lost(
        self, expected: dict[str, str], troubles: list[str], generator: random.Random
    ) -> Figures:
        """Kill the head in the middle; see that it is told, and that the next run resumes."""
        process = self.run(LONG.keys())
        self._await_middle(process, generator, *LONG)
        self.head.kill()
        killed = time.monotonic()
        status = process.wait(SECONDS_FOR_TRAINING)
        seconds = time.monotonic() - killed
        told = self.desk.log.read_text(encoding="utf-8")
        is_told = status != 0 and "is lost; once it runs again, the next run resumes" in told
        if not is_told:
            troubles.append(f"the head was killed, and this was told:\n{told}")
        with cluster(self.project, WORKERS) as other:
            process = other._start("dvc", "repro", *targets(LONG.keys()))
            status = process.wait(SECONDS_FOR_TRAINING)
            figures = other._judged(expected, troubles, "after the head", status)
            resumed = other.desk.log.read_text(encoding="utf-8").count("resumes from")
        if not resumed:
            troubles.append("nothing was resumed after the head was killed")
        own = {"killed": 1, "told": is_told, "seconds_until_dvc_ended": round(seconds, 1)}
        return own | {"resumed": resumed} | figures

    def refused(self, troubles: list[str]) -> Figures:
        """Train on a worker with a package in another version; see that it is refused."""
        status = self.run([DISTURBED]).wait(SECONDS_FOR_TRAINING)
        told = self.desk.log.read_text(encoding="utf-8")
        is_told = status != 0 and f"has {OTHER[0]} {OTHER[1]}; allowed: {OTHER[0]} " in told
        if not is_told:
            troubles.append(f"a worker has another {OTHER[0]}, and this was told:\n{told}")
        return {"told": is_told}

    def played(self) -> tuple[population.Rounds, list[population.Measured]]:
        """Train populations; measure rounds without work, and generations."""
        process = self._start("python", "-m", "soak.generations")
        lines = self._lines(process)
        found = population.read(lines, len(self.workers), self._received_by_workers)
        if process.returncode:
            raise RuntimeError(f"populations did not train:\n{self.desk.log.read_text()}")
        return found

    def _received_by_workers(self) -> int:
        return sum(worker.bytes_moved()[0] for worker in self.workers)

    def shrunk(
        self, expected: dict[str, str], troubles: list[str], generator: random.Random
    ) -> Figures:
        """Kill a worker that plays, or trains, in the middle; see that the bytes are the same."""
        process = self.run(SHARED.keys())
        self._await_middle(process, generator, *SHARED)
        self.workers[-1].kill()
        status = process.wait(SECONDS_FOR_TRAINING)
        return {"killed": 1} | self._judged(expected, troubles, "a population", status)

    def _lines(self, process: "subprocess.Popen[bytes]") -> Iterator[Figures]:
        """Yield what a process on the desk prints as JSON, as soon as it does."""
        with self.desk.log.open(encoding="utf-8") as file:
            while True:
                has_ended = process.poll() is not None
                while line := file.readline():
                    if line.startswith("{"):
                        yield json.loads(line)
                if has_ended:
                    return
                time.sleep(0.01)

    def _start(self, *command: str) -> "subprocess.Popen[bytes]":
        return self.desk.start(
            str(tools() / command[0]),
            *command[1:],
            folder=self.project.folder,
            **self.project.environment | self.variables | {"PATH": f"{tools()}:/usr/bin:/bin"},
        )

    def _await_middle(
        self, process: "subprocess.Popen[bytes]", generator: random.Random, agent: str
    ) -> None:
        """Wait for one of the first checkpoints."""
        after = generator.randrange(1, 5)
        if projects.await_checkpoint(self.project, agent, process, after) is None:
            told = self.desk.log.read_text(encoding="utf-8")
            raise RuntimeError(f"{agent} trained without a checkpoint:\n{told}")

    def _judged(
        self,
        expected: dict[str, str],
        troubles: list[str],
        name: str,
        status: int,
        stages: Sequence[str] = TRAIN,
    ) -> Figures:
        if status:
            troubles.append(f"{name}: dvc ended with {status}:\n{self.desk.log.read_text()}")
            return {"bytes_equal": 0}
        found = digests(self.project, {key.split()[0] for key in expected}, stages)
        equal = sum(found.get(key) == own for key, own in expected.items())
        if equal < len(expected):
            troubles.append(f"{name}: {equal} of {len(expected)} have the same bytes")
        return {"bytes_equal": equal}

    def _moved(self) -> int:
        """Return the bytes that the desk has received and sent, those of Ray included."""
        return sum(self.desk.bytes_moved())


@contextmanager
def cluster(
    project: Checkout, workers: Sequence[str], unlike: Path | None = None
) -> Iterator[Cluster]:
    """Start a cluster, and end it; its last worker finds other packages first, if told where."""
    environment = Path(sys.prefix)
    others = {workers[-1]: unlike} if unlike else {}
    shown = {name: [environment, *others.values()] for name in (HEAD, *workers)}
    shown[DESK] = [environment, project.folder]
    token = secrets.token_hex(16)
    with hosts.running((HEAD, DESK, *workers), shown) as found:
        head = found[HEAD]
        variables = {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": token}
        variables |= {"RAY_USAGE_STATS_ENABLED": "0", "RAY_ADDRESS": f"{head.address}:{PORT}"}
        for name, host in found.items():
            cores = 1 if name in workers else 0
            first = {"PYTHONPATH": str(others[name])} if name in others else {}
            as_head = ("--head", "--port", str(PORT), "--include-dashboard", "false")
            place = as_head if host is head else ("--address", variables["RAY_ADDRESS"])
            started = host.start(
                *(str(tools() / "ray"), "start", "--block", *place),
                *("--node-ip-address", host.address, "--num-cpus", str(cores)),
                *("--object-store-memory", str(STORE_BYTES)),
                folder=Path("/"),
                # Workers' niceness is 15 by default: others come first here.
                **variables | {"RAY_worker_niceness": "0"} | first,
            )
            _await(host, started, "Ray runtime started.")
        yield Cluster(project, found[DESK], head, [found[name] for name in workers], variables)


def tools() -> Path:
    """Return the folder of this environment's programs."""
    return Path(sys.executable).parent


def _await(host: Host, started: "subprocess.Popen[bytes]", line: str) -> None:
    deadline = time.monotonic() + SECONDS_TO_JOIN
    while line not in host.log.read_text(encoding="utf-8"):
        if started.poll() is not None or time.monotonic() > deadline:
            raise RuntimeError(f"{host.name}: {host.log.read_text(encoding='utf-8')}")
        time.sleep(0.1)


if __name__ == "__main__":
    main()
