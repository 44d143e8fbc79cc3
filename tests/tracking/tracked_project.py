"""A project as the pipeline leaves it, and what a database says about it."""

import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from jumping_ant.base.files import PROJECT_ROOT, write_bytes, write_json, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.params import params_file
from jumping_ant.policies import policy_file
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.tracking import live
from jumping_ant.tracking.mirror import track
from jumping_ant.training import curves

AGENTS, SEEDS, STEPS = ("sac", "pgpe"), (0, 1), (100, 200, 300, 400)
AGGREGATES = tuple(f"{agent}, {len(SEEDS)} seeds" for agent in AGENTS)  # runs of all seeds
NUM_RUNS = 1 + len(AGGREGATES) + len(AGENTS) * len(SEEDS)  # the comparison, agents, seeds
HEADER = "agent,seed,env_steps,updates,episodes,return_mean,evaluation_return_mean,loss"


def curve_lines(seed: int, steps: tuple[int, ...] = STEPS, agent: str = "sac") -> str:
    """One evaluation, in the third row; the first row has no finished episode."""
    rows = [
        f"{agent},{seed},{step},{step},{step // 100},{'' if step == 100 else step + seed},"
        f"{step * 2 + seed if step == 300 else ''},{1 / step}"
        for step in steps
    ]
    return "\n".join([HEADER, *rows]) + "\n"


def write_rows(path: Path, header: str, rows: list[str]) -> None:
    write_text(path, "\n".join([header, *rows, ""]))


def train(root: Path, agent: str, seed: int, value: float | None = None) -> None:
    paths = Paths(root).agent(agent).seed(seed)
    write_text(paths.curve, curve_lines(seed, agent=agent))
    header = f"agent,seed,{','.join(curves.VALIDATION_COLUMNS)}"
    write_rows(paths.validation, header, [f"{agent},{seed},300,20,{600 + seed},1.5"])
    number = AGENTS.index(agent) + 0.1 * (seed + 1) if value is None else value
    full = partial(np.full, fill_value=number, dtype=np.float32)
    layer = full((8, 27)), full(8)
    policy = LinearPolicy(*layer, full(27), full(27), *layer, ActionSet())
    write_bytes(paths.policy, policy_file.owned(policy.to_bytes(), paths.owner))


def evaluate(root: Path, agent: str) -> None:
    """Mean return of seed 0: 15, of seed 1: 115; the video shows seed 1. No seed has a fluidity."""
    paths = Paths(root).agent(agent)
    timing = [f"{agent},{seed},{step},{step / 10}" for seed in SEEDS for step in STEPS]
    write_rows(paths.timing, "agent,seed,env_steps,seconds", timing)
    write_json(paths.machines, {str(seed): {"cpu": "a"} for seed in SEEDS})
    means = [f"{agent},{seed},{100 * seed + 15},2.5,0.25," for seed in SEEDS]
    write_rows(paths.seed_means, "agent,seed,return,apex,flight,fluidity", means)
    kinds = {"final": 50, "best_sample": 9}.items()
    variants = [f"{agent},{seed},{name},{more + seed}" for seed in SEEDS for name, more in kinds]
    write_rows(paths.variants, "agent,seed,variant,return", variants)
    states = {"qpos": np.zeros((3, 15)), "qvel": np.zeros((3, 14)), "torques": np.zeros((2, 8))}
    rest = {"episode": 0, "episode_return": 115.0, "timestep": 0.01, "frame_skip": 1}
    episode = Trajectory(**states, rewards=np.zeros(2), terms={}, agent=agent, seed=1, **rest)
    write_bytes(paths.trajectory, episode.to_bytes())
    write_bytes(paths.film, b"video of " + agent.encode())
    write_bytes(paths.recording, b"recording of " + agent.encode())


def compare(root: Path) -> None:
    interval = {"iqm": 65.0, "low": 15.0, "high": 115.0, "mean": 66.0, "worst": 15.0}
    entry = {"seeds": 2, "return": interval, "env_steps": 400}
    leads = {"text": "SAC leads", "verdict": "inconclusive", "p_adjusted": 0.75}
    chances = {"sac>pgpe": {"p": 0.75, "low": 0.5, "high": 1.0}}
    summary = {"agents": dict.fromkeys(AGENTS, entry), "claims": [leads]}
    write_json(Paths(root).comparison, summary | {"probability_of_improvement": chances})
    equal = {"iqm": 60.0, "low": 10.0, "high": 110.0}
    timed = {"train_seconds": 40.0, "return_at_equal_seconds": equal}
    slow = {"text": "PGPE is slow", "verdict": "supported", "p_adjusted": 0.01}
    speed = {"agents": dict.fromkeys(AGENTS, timed), "claims": [slow]}
    write_json(Paths(root).speed, speed | {"equal_seconds": 30.0})
    ends = [f"{step}.0,{step},{step - 5},{step + 5}" for step in (200, 400)]
    points = [f"{agent},{end}" for agent in AGENTS for end in ends]
    path = Paths(root).plots / "learning_curves.csv"
    write_rows(path, "agent,env_steps,return_iqm,low,high", points)
    write_bytes(Paths(root).figures / "curves.png", b"picture")
    write_text(Paths(root).report, "<h1>Report</h1>")


def make_bare(root: Path, database: Path) -> None:
    yaml = YAML()
    content = yaml.load((PROJECT_ROOT / "params.yaml").read_text(encoding="utf-8"))
    content["seeds"] = list(SEEDS)
    content["agents"] = {agent: content["agents"][agent] for agent in AGENTS}
    root.mkdir(parents=True)
    with (root / "params.yaml").open("w", encoding="utf-8") as file:
        yaml.dump(content, file)
    write_json(Paths(root).physique, {"after": {"mass": 0.44, "parts": {"leg": 1}}})
    shutil.copy(database, root / "mlflow.db")


def make_whole(root: Path) -> None:
    for agent in AGENTS:
        for seed in SEEDS:
            train(root, agent, seed)
        evaluate(root, agent)
    compare(root)


def follow(root: Path, has_ended: Callable[[float], bool]) -> None:
    """Follow the training of an agent with the parameters of its project."""
    live.follow("sac", root, params_file.load(root / "params.yaml"), has_ended)


def copy_tracked(template: Path, root: Path) -> None:
    """Copy a project, and have its database say where the copy's artifacts are."""
    shutil.copytree(template, root)
    for table in ("experiments", "runs", "logged_models"):
        column = "artifact_uri" if table == "runs" else "artifact_location"
        sql = f"UPDATE {table} SET {column} = replace({column}, ?, ?)"
        query(root, sql, template.as_uri(), root.as_uri())


def unset_variables(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("TRACKING_URI", "HTTP_REQUEST_MAX_RETRIES", "HTTP_REQUEST_TIMEOUT"):
        monkeypatch.setenv(f"MLFLOW_{name}", "")  # so that it is restored even if it is set later
        monkeypatch.delenv(f"MLFLOW_{name}")


def query(root: Path, sql: str, *arguments: object) -> list[tuple]:
    with closing(sqlite3.connect(root / "mlflow.db")) as connection, connection:
        return connection.execute(sql, arguments).fetchall()


@dataclass(frozen=True)
class Shown:
    """What MLflow says of a run that is not deleted."""

    id: str
    status: str
    metrics: list[tuple[str, int, float]]  # name, step, value
    params: dict[str, str]
    tags: dict[str, str]
    artifacts: Path

    @property
    def files(self) -> set[str]:
        """Its files, by their path in it."""
        paths = [path for path in self.artifacts.rglob("*") if path.is_file()]
        return {str(path.relative_to(self.artifacts)) for path in paths}


def shown(root: Path, name: str = "%") -> dict[str, Shown]:
    """The runs that are not deleted, by name; two of a name are an error."""
    sql = "SELECT run_uuid, name, status FROM runs WHERE lifecycle_stage = 'active' AND name LIKE ?"
    found = query(root, sql, name)
    of_run = "FROM {} WHERE run_uuid = ? ORDER BY key".format
    runs = {
        name: Shown(
            run,
            status,
            query(root, f"SELECT key, step, value {of_run('metrics')}, step", run),
            dict(query(root, f"SELECT key, value {of_run('params')}", run)),
            dict(query(root, f"SELECT key, value {of_run('tags')}", run)),
            root / "mlartifacts" / run / "artifacts",
        )
        for run, name, status in found
    }
    assert len(runs) == len(found), found
    return runs


def statuses(root: Path) -> dict[str, str]:
    return {name: run.status for name, run in shown(root).items()}


def parent_name(root: Path, name: str) -> str:
    parent = shown(root, name)[name].tags["mlflow.parentRunId"]
    return str(query(root, "SELECT name FROM runs WHERE run_uuid = ?", parent)[0][0])


def state(root: Path) -> tuple[dict[str, int], dict[str, int]]:
    """Rows of every table, and time of every artifact: what a call that adds nothing leaves."""
    tables = [row[0] for row in query(root, "SELECT name FROM sqlite_master WHERE type = 'table'")]
    files = [path for path in (root / "mlartifacts").rglob("*") if path.is_file()]
    return (
        {table: query(root, f"SELECT COUNT(*) FROM {table}")[0][0] for table in tables},
        {str(path): path.stat().st_mtime_ns for path in files},
    )


def meaning(root: Path) -> tuple[object, ...]:
    """What MLflow says, without ids and times."""
    runs = {
        name: (run.status, run.metrics, run.params, run.tags.get("policy_digest"), run.files)
        for name, run in shown(root).items()
    }
    versions = query(
        root,
        "SELECT v.name, v.description, r.name, a.alias FROM model_versions v "
        "LEFT JOIN runs r ON r.run_uuid = v.run_id "
        "LEFT JOIN registered_model_aliases a ON a.name = v.name AND a.version = v.version "
        "WHERE v.current_stage <> 'Deleted_Internal' ORDER BY v.name, v.description",
    )
    return runs, versions


def tracked(root: Path) -> list[str]:
    lines: list[str] = []
    track(root, lines.append)
    return lines


@dataclass(frozen=True)
class OnServer:
    """A project on an MLflow server of its own, and what tracking the project said."""

    address: str
    folder: Path  # the server's, with its database
    project: Path
    lines: list[str]
