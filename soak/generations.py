"""Train populations on the cluster that RAY_ADDRESS names, and print each generation as it ends.

Usage: python -m soak.generations

Each line is JSON. The first has the seconds of rounds in which parts do nothing: for each number
of other cores, and of one that sends some bytes. The others have a population, and the seconds of
its training so far or, in the end, the digest of its policy. `soak.cluster` runs it on the desk.
"""

import hashlib
import json
import operator
import time
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.events import Finished, Progress
from jumping_ant.agents.job import Job
from jumping_ant.base import command_line
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.compute import cluster, jobs
from jumping_ant.compute.cluster_parts import ClusterParts, ClusterSpread
from jumping_ant.experiment import params_file
from jumping_ant.sim import robot
from jumping_ant.sim.world import World
from jumping_ant.training import seed_run
from jumping_ant.training.seed_run import Report

AGENT, SEED = "pgpe", 0
POPULATIONS = {40: 40, 200: 20, 1000: 8}  # and how many generations of each
STEPS = 10  # of an episode: of many short generations, some are hardly disturbed
ROUNDS, FEW_ROUNDS = 200, 10  # of parts that do nothing, or send bytes; the fastest counts
BYTES = 2**24


def main() -> None:
    """Measure, and print."""
    command_line.parser(__doc__, "python -m soak.generations").parse_args()
    _tell(_rounds())
    training = params_file.load().training.model_copy(
        update={"evaluation_episodes": 1, "finalist_episodes": 1}
    )
    for population in POPULATIONS:
        job = replace(job_of(PROJECT_ROOT, population), spread=ClusterSpread(1))
        works = {population: partial(seed_run.run, job, training)}
        for _, report in jobs.stream(works.__getitem__, works, 1):
            _tell_report(population, report)


def job_of(root: Path, population: int) -> Job[AgentBlock]:
    """Return a training of a population in a project, with episodes of a few steps."""
    params = params_file.load(root / "params.yaml")
    agent = params.agent(AGENT).model_copy(
        update={
            "population_size": population,
            "generations": POPULATIONS[population],
            "episode_steps": STEPS,
        }
    )
    env = params.env.model_copy(update={"max_episode_steps": STEPS})
    world = World(robot.read(root, agent.robot), env)
    return Job(world, agent, SEED)


def _rounds() -> Mapping[str, Any]:
    """Return the seconds of rounds of parts that do nothing."""
    joined = cluster.Cluster(cluster.address() or "")
    import ray

    cores = int(ray.cluster_resources()["CPU"])
    empty = {count: _round(count) for count in range(1, cores + 1)}
    full = _round(1, BYTES)
    joined.close()
    return {"rounds": empty, "full": full, "bytes": BYTES}


def _round(num_others: int, size: int = 0) -> float:
    """Return the seconds of a round of others that send bytes; their cores are free afterwards."""
    parts = ClusterParts(partial(bytes, size), num_others + 1, num_others)
    seconds = []
    for _ in range(ROUNDS if size == 0 else FEW_ROUNDS):
        started = time.perf_counter()
        parts.map(operator.concat, lambda rows: b"")
        seconds.append(time.perf_counter() - started)
    return min(seconds)


def _tell_report(population: int, report: Report) -> None:
    if isinstance(report.event, Progress):
        _tell({"population": population, "seconds": report.seconds})
    elif isinstance(report.event, Finished):
        digest = hashlib.sha256(report.event.policy).hexdigest()
        _tell({"population": population, "policy": digest})


def _tell(line: Mapping[str, object]) -> None:
    print(json.dumps(line), flush=True)


if __name__ == "__main__":
    main()
