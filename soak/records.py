"""The records of a comparison in MLflow, while several trainings write to a server on SQLite.

The server is killed and restarted, and its tables are locked. Afterwards runs, models and an
experiment are deleted by hand. After each, what `track` leaves must be what the files say.
"""

import os
import random
import sqlite3
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path
from subprocess import Popen

import mlflow
from mlflow import MlflowClient
from mlflow.entities import Run

from jumping_ant.base.files import digest
from jumping_ant.base.paths import Paths
from jumping_ant.params import params_file, presets
from jumping_ant.tracking import records
from scripts.checkout import Checkout
from soak import mlflow_server
from soak import project as projects
from soak.mlflow_server import Server
from soak.project import Count

DATABASE = "mlflow.db"
SECONDS_LOCKED = 25.0  # longer than `track` waits
SECONDS_BETWEEN = 10.0  # of calm, in which records are written


def keep(project: Checkout, generator: random.Random, troubles: list[str]) -> dict[str, Count]:
    """Run a comparison under disturbances; return counts, and add what is wrong to the troubles."""
    content = presets.load("smoke").model_dump()
    for agent in projects.LEARNERS:
        content["agents"][agent] |= projects.BUDGETS[agent]
    content["compute"] |= {"live_after_seconds": 0, "workers": 1}
    params = params_file.check(content)
    project.write_params(params)
    project.seconds("dvc", "repro", "build")
    with (
        tempfile.TemporaryDirectory() as folder,
        mlflow_server.running(Path(folder) / "server", f"sqlite:///{folder}/{DATABASE}") as server,
    ):
        log, database = Path(folder) / "log", Path(folder) / DATABASE
        os.environ["MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR"] = "false"
        start = partial(projects.start, project, log=log, MLFLOW_TRACKING_URI=server.uri)
        disturbances: dict[str, Callable[[], None]] = {
            "server killed": lambda: _restart(server),
            "table locked": lambda: _lock(database),
        }
        train = (sys.executable, "-m", "stages.train")
        learners = [agent for agent, block in params.agents.items() if not block.is_baseline]
        for commands in ([(*train, agent) for agent in learners], [("dvc", "repro")]):
            processes = [start(*command) for command in commands]
            for name in generator.sample(list(disturbances), len(disturbances)):
                time.sleep(SECONDS_BETWEEN)
                disturbances[name]()
                print(name, flush=True)
            for process in processes:
                process.wait()
        client = MlflowClient(server.uri)
        track = partial(start, sys.executable, "-m", "stages.track")
        wrong = _tracked(project, track, log, client)
        counts = {name: {"done": 2, "right": 0 if wrong else 2} for name in disturbances}
        troubles += wrong
        live = sum(run.data.tags.get("live") == "true" for run in _runs(client))
        counts["live runs"] = {"done": live}
        if not live:
            troubles.append("records: no curve was live")
        for name, delete in DELETIONS.items():
            delete(client)
            wrong = _tracked(project, track, log, client)
            counts[name] = {"done": 1, "right": int(not wrong)}
            troubles += [f"{name}: {line}" for line in wrong]
    return counts


def _restart(server: Server) -> None:
    server.kill()
    time.sleep(1.0)
    server.start()


def _lock(database: Path) -> None:
    with closing(sqlite3.connect(database, SECONDS_LOCKED, isolation_level=None)) as connection:
        connection.execute("BEGIN EXCLUSIVE")
        time.sleep(SECONDS_LOCKED)


def _tracked(
    project: Checkout, track: Callable[[], Popen[bytes]], log: Path, client: MlflowClient
) -> list[str]:
    """Bring the records up to date, twice, and return what is not as the files say."""
    for _ in range(2):
        if track().wait():
            return [f"track: {log.read_text(encoding='utf-8')[-1000:]}"]
    last = log.read_text(encoding="utf-8").splitlines()[-1]
    wrong = [] if last.endswith(" unchanged") else [f"track again: {last}"]
    return wrong + _differences(project.folder, client)


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
    statuses = {name: run.info.status for name, run in runs.items()}
    wrong += [f"{name}: {status}" for name, status in statuses.items() if status != "FINISHED"]
    mlflow.set_tracking_uri(client.tracking_uri)
    for agent in params.agents:
        for seed in params.seeds:
            if run_of_seed := runs.get(f"{agent}-seed-{seed}"):
                wrong += _differences_of_seed(root, client, run_of_seed, agent, seed)
        champion = client.get_model_version_by_alias(f"jumping-ant-{agent}", "champion")
        versions = client.search_model_versions(f"name = 'jumping-ant-{agent}'")
        is_known = any(run.info.run_id == champion.run_id for run in runs.values())
        if len(versions) != len(params.seeds) or not is_known:
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


def _delete_runs(client: MlflowClient) -> None:
    for run in _runs(client)[::2]:
        client.delete_run(run.info.run_id)


def _delete_models(client: MlflowClient) -> None:
    first, second, *_ = client.search_registered_models()
    client.delete_registered_model(first.name)
    client.delete_registered_model_alias(second.name, "champion")
    for version in client.search_model_versions(f"name = '{second.name}'")[:1]:
        client.delete_model_version(second.name, version.version)


def _delete_experiment(client: MlflowClient) -> None:
    client.delete_experiment(_experiment(client))


def _runs(client: MlflowClient) -> list[Run]:
    return list(client.search_runs([_experiment(client)]))


def _experiment(client: MlflowClient) -> str:
    (experiment,) = client.search_experiments(filter_string="name = 'jumping-ant'")
    return str(experiment.experiment_id)


DELETIONS = {  # what a person may delete
    "runs deleted": _delete_runs,
    "models deleted": _delete_models,
    "experiment deleted": _delete_experiment,
}
