"""The records of a comparison in MLflow, while its server comes and goes and its tables are locked.

Several trainings write at once to a server on SQLite. Meanwhile the server is killed and restarted,
and its tables are locked. Afterwards runs, models and an experiment are deleted by hand. After
each, what `track` leaves must be what the files say.
"""

import os
import random
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import mlflow
from mlflow import MlflowClient
from mlflow.entities import Run

from jumping_ant.base.files import digest
from jumping_ant.base.paths import Paths
from jumping_ant.params import params_file, presets
from jumping_ant.params.model import Params
from jumping_ant.tracking import records
from scripts.checkout import Checkout
from soak import mlflow_server
from soak import project as projects
from soak.mlflow_server import Server

EXPERIMENT = "jumping-ant"
DATABASE = "mlflow.db"
SECONDS_LOCKED = 25.0  # longer than `track` waits
SECONDS_BETWEEN = 10.0  # of calm, in which records are written


@dataclass
class Count:
    """How often something was done, and how often the records were right afterwards."""

    done: int = 0
    right: int = 0


def settings() -> Params:
    """Return the parameters of the preset `smoke`, with live curves from the start."""
    content = presets.load("smoke").model_dump()
    for agent in projects.LEARNERS:
        content["agents"][agent] |= projects.BUDGETS[agent]
    content["compute"] |= {"live_after_seconds": 0, "workers": 1}
    return params_file.check(content)


def keep(
    project: Checkout, generator: random.Random, troubles: list[str]
) -> dict[str, dict[str, int]]:
    """Run a comparison under disturbances; return counts, and add what is wrong to the troubles."""
    project.write_params(settings())
    project.seconds("dvc", "repro", "build")
    with (
        tempfile.TemporaryDirectory() as name,
        mlflow_server.running(Path(name) / "server", f"sqlite:///{name}/{DATABASE}") as server,
    ):
        log, database = Path(name) / "log", Path(name) / DATABASE
        os.environ["MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR"] = "false"
        start = partial(projects.start, project, log=log, MLFLOW_TRACKING_URI=server.uri)
        disturbances: dict[str, Callable[[], None]] = {
            "server killed": lambda: _restart(server),
            "table locked": lambda: _lock(database),
        }
        counts = {name: Count() for name in disturbances}
        trainings = [
            start(sys.executable, "-m", "stages.train", agent)
            for agent, block in settings().agents.items()
            if not block.is_baseline
        ]
        _disturb(trainings, disturbances, counts, generator)
        _disturb([start("dvc", "repro")], disturbances, counts, generator)
        wrong = _tracked(project, server, log)
        for count in counts.values():
            count.right = 0 if wrong else count.done
        troubles += wrong
        live = _number_live(MlflowClient(server.uri))
        if not live:
            troubles.append("records: no curve was live")
        for name, delete in _deletions(MlflowClient(server.uri)).items():
            delete()
            wrong = _tracked(project, server, log)
            counts[name] = Count(1, int(not wrong))
            troubles += [f"{name}: {line}" for line in wrong]
    return {name: vars(count) for name, count in counts.items()} | {"live runs": {"done": live}}


def _disturb(
    processes: Sequence["subprocess.Popen[bytes]"],
    disturbances: dict[str, Callable[[], None]],
    counts: dict[str, Count],
    generator: random.Random,
) -> None:
    """Disturb in each way once, in some order, and wait until all processes have ended."""
    for name in generator.sample(list(disturbances), len(disturbances)):
        time.sleep(SECONDS_BETWEEN)
        disturbances[name]()
        counts[name].done += 1
        print(f"{name}: {counts[name].done}", flush=True)
    for process in processes:
        process.wait()


def _restart(server: Server) -> None:
    server.kill()
    time.sleep(1.0)
    server.start()


def _lock(database: Path) -> None:
    with closing(sqlite3.connect(database, SECONDS_LOCKED, isolation_level=None)) as connection:
        connection.execute("BEGIN EXCLUSIVE")
        time.sleep(SECONDS_LOCKED)


def _tracked(project: Checkout, server: Server, log: Path) -> list[str]:
    """Bring the records up to date, twice, and return what is not as the files say."""
    for _ in range(2):
        process = projects.start(
            *(project, sys.executable, "-m", "stages.track"),
            log=log,
            MLFLOW_TRACKING_URI=server.uri,
        )
        if process.wait():
            return [f"track: {log.read_text(encoding='utf-8')[-1000:]}"]
    last = log.read_text(encoding="utf-8").splitlines()[-1]
    wrong = [] if last.endswith(" unchanged") else [f"track again: {last}"]
    return wrong + list(_differences(project.folder, MlflowClient(server.uri)))


def _differences(root: Path, client: MlflowClient) -> list[str]:
    """Return where the records are other than the files."""
    params = params_file.load(root / "params.yaml")
    runs: dict[str, Run] = {}
    wrong: list[str] = []
    for run in _runs(client):
        wrong += [f"{run.info.run_name}: twice"] if run.info.run_name in runs else []
        runs[run.info.run_name] = run
    seeds = {f"{agent}-seed-{seed}" for agent in params.agents for seed in params.seeds}
    comparisons = [name for name in runs if name.startswith("comparison")]
    aggregates = {f"{agent}, {len(params.seeds)} seeds" for agent in params.agents}
    if len(comparisons) != 1 or runs.keys() != seeds | aggregates | set(comparisons):
        wrong.append(f"runs: {sorted(runs)}")
    wrong += [f"{name}: {run.info.status}" for name, run in runs.items() if not _is_over(run)]
    mlflow.set_tracking_uri(client.tracking_uri)
    for agent in params.agents:
        for seed in params.seeds:
            if own := runs.get(f"{agent}-seed-{seed}"):
                wrong += _differences_of_seed(root, client, own, agent, seed)
        champion = client.get_model_version_by_alias(f"jumping-ant-{agent}", "champion")
        versions = client.search_model_versions(f"name = 'jumping-ant-{agent}'")
        if len(versions) != len(params.seeds) or champion.run_id not in {
            run.info.run_id for run in runs.values()
        }:
            wrong.append(f"{agent}: {len(versions)} versions, champion {champion.version}")
    return wrong


def _differences_of_seed(
    root: Path, client: MlflowClient, run: Run, agent: str, seed: int
) -> list[str]:
    policy = Paths(root).agent(agent).seed(seed).policy
    wrong = []
    with tempfile.TemporaryDirectory() as folder:
        stored = client.download_artifacts(run.info.run_id, "policy.zip", folder)
        if digest(Path(stored)) != digest(policy):
            wrong.append("another policy")
    if run.data.tags.get("policy_digest") != digest(policy):
        wrong.append("the digest of another policy")
    curve = records.read_curve(root, agent, seed)
    points = {
        (name, point.step)
        for name in {name for name, _ in curve}
        for point in client.get_metric_history(run.info.run_id, name)
    }
    if points != curve.keys():
        wrong.append(f"{len(points)} points of {len(curve)}")
    return [f"{run.info.run_name}: {line}" for line in wrong]


def _deletions(client: MlflowClient) -> dict[str, Callable[[], None]]:
    """Return what a person may delete, by what it is."""

    def delete_runs() -> None:
        for run in _runs(client)[::2]:
            client.delete_run(run.info.run_id)

    def delete_models() -> None:
        first, second, *_ = client.search_registered_models()
        client.delete_registered_model(first.name)
        client.delete_registered_model_alias(second.name, "champion")
        for version in client.search_model_versions(f"name = '{second.name}'")[:1]:
            client.delete_model_version(second.name, version.version)

    def delete_experiment() -> None:
        client.delete_experiment(_experiment(client))

    return {
        "runs deleted": delete_runs,
        "models deleted": delete_models,
        "experiment deleted": delete_experiment,
    }


def _number_live(client: MlflowClient) -> int:
    """Return how many runs were written while training ran."""
    return sum(run.data.tags.get("live") == "true" for run in _runs(client))


def _runs(client: MlflowClient) -> list[Run]:
    return list(client.search_runs([_experiment(client)]))


def _experiment(client: MlflowClient) -> str:
    found = client.get_experiment_by_name(EXPERIMENT)
    if found is None:
        raise RuntimeError(f"there is no experiment {EXPERIMENT}")
    return str(found.experiment_id)


def _is_over(run: Run) -> bool:
    return bool(run.info.status == "FINISHED")
