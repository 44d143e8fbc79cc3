"""A project as the pipeline leaves it, and what a database says about it."""

import os
import shutil
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from jumping_ant.base.files import PROJECT_ROOT, write_bytes, write_json, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.policies import policy_file
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.linear import LinearPolicy
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.tracking.mirror import track
from jumping_ant.training import curves
from soak import mlflow_server

AGENTS, SEEDS, STEPS = ("sac", "pgpe"), (0, 1), (100, 200, 300, 400)
AGGREGATES = tuple(f"{agent}, {len(SEEDS)} seeds" for agent in AGENTS)  # runs of all seeds
HEADER = "agent,seed,env_steps,updates,episodes,return_mean,evaluation_return_mean,loss"

FRESH_PROCESS = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}


def policy_content(value: float) -> bytes:
    def full(*shape: int) -> np.ndarray:
        return np.full(shape, value, np.float32)

    weight, bias = full(8, 27), full(8)
    return LinearPolicy(weight, bias, full(27), full(27), weight, bias, ActionSet()).to_bytes()


def curve_lines(seed: int, steps: tuple[int, ...] = STEPS, agent: str = "sac") -> str:
    """One evaluation, in the third row; the first row has no finished episode."""
    rows = [
        f"{agent},{seed},{step},{step},{step // 100},{'' if step == 100 else step + seed},"
        f"{step * 2 + seed if step == 300 else ''},{1 / step}"
        for step in steps
    ]
    return "\n".join([HEADER, *rows]) + "\n"


def train(root: Path, agent: str, seed: int, value: float | None = None) -> None:
    paths = Paths(root).agent(agent).seed(seed)
    write_text(paths.curve, curve_lines(seed, agent=agent))
    row = f"{agent},{seed},300,20,{600 + seed},1.5\n"
    write_text(paths.validation, f"agent,seed,{','.join(curves.VALIDATION_COLUMNS)}\n{row}")
    number = AGENTS.index(agent) + 0.1 * (seed + 1) if value is None else value
    write_bytes(paths.policy, policy_file.owned(policy_content(number), paths.owner))


def evaluate(root: Path, agent: str) -> None:
    """Mean return of seed 0: 15, of seed 1: 115; the video shows seed 1. No seed has a fluidity."""
    paths = Paths(root).agent(agent)
    timing = [f"{agent},{seed},{step},{step / 10}\n" for seed in SEEDS for step in STEPS]
    write_text(paths.timing, "".join(["agent,seed,env_steps,seconds\n", *timing]))
    write_json(paths.machines, {str(seed): {"cpu": "a"} for seed in SEEDS})
    rows = "".join(f"{agent},{seed},{100 * seed + 15},2.5,0.25,\n" for seed in SEEDS)
    means = f"agent,seed,return,apex,flight,fluidity\n{rows}"
    variants = [("final", 50), ("rounded", 9)]
    lines = [f"{agent},{seed},{name},{more + seed}\n" for seed in SEEDS for name, more in variants]
    write_text(paths.variants, "".join(["agent,seed,variant,return\n", *lines]))
    write_text(paths.seed_means, means)
    states = {"qpos": np.zeros((3, 15)), "qvel": np.zeros((3, 14)), "torques": np.zeros((2, 8))}
    rest = {"episode": 0, "episode_return": 115.0, "timestep": 0.01, "frame_skip": 1}
    episode = Trajectory(**states, rewards=np.zeros(2), terms={}, agent=agent, seed=1, **rest)
    write_bytes(paths.trajectory, episode.to_bytes())
    write_bytes(paths.film, b"video of " + agent.encode())
    write_bytes(paths.recording, b"recording of " + agent.encode())


def compare(root: Path) -> None:
    interval = {"iqm": 65.0, "low": 15.0, "high": 115.0, "mean": 66.0, "worst": 15.0}
    entry = {"seeds": 2, "return": interval, "env_steps": 400}
    write_json(
        Paths(root).comparison,
        {
            "agents": dict.fromkeys(AGENTS, entry),
            "probability_of_improvement": {"sac>pgpe": {"p": 0.75, "low": 0.5, "high": 1.0}},
            "claims": [{"text": "SAC leads", "verdict": "inconclusive", "p_adjusted": 0.75}],
        },
    )
    equal = {"iqm": 60.0, "low": 10.0, "high": 110.0}
    timed = {"train_seconds": 40.0, "return_at_equal_seconds": equal}
    heavy = {"text": "PGPE is slow", "verdict": "supported", "p_adjusted": 0.01}
    agents = dict.fromkeys(AGENTS, timed)
    write_json(Paths(root).speed, {"agents": agents, "equal_seconds": 30.0, "claims": [heavy]})
    points = [
        f"{agent},{step}.0,{step},{step - 5},{step + 5}" for agent in AGENTS for step in (200, 400)
    ]
    lines = ["agent,env_steps,return_iqm,low,high", *points, ""]
    write_text(Paths(root).plots / "learning_curves.csv", "\n".join(lines))
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


def copy_tracked(template: Path, root: Path) -> None:
    """Copy a project, and have its database say where the copy's artifacts are."""
    shutil.copytree(template, root)
    for table, column in (
        ("experiments", "artifact_location"),
        ("runs", "artifact_uri"),
        ("logged_models", "artifact_location"),
    ):
        sql = f"UPDATE {table} SET {column} = replace({column}, ?, ?)"
        query(root, sql, template.as_uri(), root.as_uri())


def unset_variables(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("TRACKING_URI", "HTTP_REQUEST_MAX_RETRIES", "HTTP_REQUEST_TIMEOUT"):
        monkeypatch.setenv(f"MLFLOW_{name}", "")  # so that it is restored even if it is set later
        monkeypatch.delenv(f"MLFLOW_{name}")


def query(root: Path, sql: str, *arguments: object) -> list[tuple]:
    connection = sqlite3.connect(root / "mlflow.db")
    rows = connection.execute(sql, arguments).fetchall()
    connection.commit()
    connection.close()
    return rows


def runs(root: Path, name: str = "%") -> dict[str, str]:
    """Name and status of the runs that are not deleted; two of a name are an error."""
    found = query(
        root,
        "SELECT name, status FROM runs WHERE lifecycle_stage = 'active' AND name LIKE ?",
        name,
    )
    assert len(found) == len(dict(found)), found
    return dict(found)


def content(root: Path, table: str, name: str) -> list[tuple]:
    """Rows of a run's metrics, params or tags."""
    columns = "m.key, m.step, m.value" if table == "metrics" else "m.key, m.value"
    return sorted(
        query(
            root,
            f"SELECT {columns} FROM {table} m JOIN runs r ON r.run_uuid = m.run_uuid "
            "WHERE r.name = ? AND r.lifecycle_stage = 'active'",
            name,
        )
    )


def parent_name(root: Path, name: str) -> str:
    tag = dict(content(root, "tags", name))["mlflow.parentRunId"]
    return str(query(root, "SELECT name FROM runs WHERE run_uuid = ?", tag)[0][0])


def artifact_dir(root: Path, name: str) -> Path:
    sql = "SELECT run_uuid FROM runs WHERE name = ? AND lifecycle_stage = 'active'"
    return root / "mlartifacts" / query(root, sql, name)[0][0] / "artifacts"


def state(root: Path) -> tuple[dict[str, int], dict[str, int]]:
    """Rows of every table, and time of every artifact: what a call that adds nothing leaves."""
    tables = [row[0] for row in query(root, "SELECT name FROM sqlite_master WHERE type = 'table'")]
    files = [path for path in (root / "mlartifacts").rglob("*") if path.is_file()]
    return (
        {table: query(root, f"SELECT COUNT(*) FROM {table}")[0][0] for table in tables},
        {str(path): path.stat().st_mtime_ns for path in files},
    )


def meaning(root: Path) -> dict[str, object]:
    """What MLflow says, without ids and times."""
    said: dict[str, object] = {"runs": runs(root)}
    for name in runs(root):
        said[name] = (
            content(root, "metrics", name),
            content(root, "params", name),
            [tag for tag in content(root, "tags", name) if tag[0] in ("agent", "policy_digest")],
            sorted(path.name for path in artifact_dir(root, name).rglob("*") if path.is_file()),
        )
    said["versions"] = query(
        root,
        "SELECT v.name, v.description, r.name, a.alias FROM model_versions v "
        "LEFT JOIN runs r ON r.run_uuid = v.run_id "
        "LEFT JOIN registered_model_aliases a ON a.name = v.name AND a.version = v.version "
        "WHERE v.current_stage <> 'Deleted_Internal' ORDER BY v.name, v.description",
    )
    return said


def tracked(root: Path) -> list[str]:
    lines: list[str] = []
    track(root, lines.append)
    return lines


def run_python(code: str, *arguments: str, cwd: Path, **environment: str) -> str:
    """Run Python in a process of its own that does not find the package by itself."""
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=cwd,
        env=FRESH_PROCESS | environment,
        capture_output=True,
        encoding="utf-8",
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


@dataclass(frozen=True)
class OnServer:
    """A project on an MLflow server of its own, and what tracking the project said."""

    address: str
    folder: Path  # the server's, with its database
    project: Path
    told: list[str]


@contextmanager
def served(folder: Path, database: Path) -> Iterator[str]:
    """Run an MLflow server in a folder, from a copy of a database, and yield its address."""
    folder.mkdir()
    shutil.copy(database, folder / "mlflow.db")
    with mlflow_server.running(folder, f"sqlite:///{folder / 'mlflow.db'}") as server:
        yield server.uri


def wait_for(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.1)
