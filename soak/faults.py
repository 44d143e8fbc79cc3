"""Faults in everything that training depends on, each repaired or survived.

A fault is survived if what it must not affect is the same as without it: mostly the bytes of the
models that are trained meanwhile or afterwards.
"""

import resource
import shutil
import socket
import sqlite3
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from jumping_ant.sim import robot
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World
from scripts.checkout import Checkout, copy_project
from soak import project as projects
from soak.injector import AGENT, TRACK, TRAIN, Injector

FILE_LIMIT = 20_000  # [bytes] between the sizes of a learning curve and a checkpoint
SECONDS_TO_WAIT = 120.0


class Faults(Injector):
    """Faults in training and in MLflow."""

    def _faults(self) -> dict[str, Callable[[], bool]]:
        return {
            "torn_checkpoint": partial(self._damaged_checkpoint, self._tear),
            "corrupt_checkpoint": partial(self._damaged_checkpoint, self._flip),
            "disk_full": self._disk_full,
            "worker_death": self._worker_death,
            "mlflow_down": self._mlflow_down,
            "mlflow_slow": self._mlflow_slow,
            "mlflow_wiped": self._mlflow_wiped,
            "mlflow_half_written": self._mlflow_half_written,
            "run_left_running": self._run_left_running,
            "two_pipelines_one_store": self._two_pipelines_one_store,
            "diverging_simulation": self._diverging_simulation,
        }

    def _damaged_checkpoint(self, damage: Callable[[bytes], bytes]) -> bool:
        """Damage the newest checkpoint of a killed training; it must resume from the one before."""
        process = self._start_training()
        projects.await_checkpoint(self._project, AGENT, process, after=1)
        projects.kill(projects.family(process))
        checkpoints = projects.checkpoints(self._project, AGENT)
        for newest in checkpoints[-1:]:
            newest.write_bytes(damage(newest.read_bytes()))
        done = self._run(*TRAIN)
        is_told = all(f"{newest.name} is damaged" in done.stdout for newest in checkpoints[-1:])
        return done.returncode == 0 and is_told and self._digest() == self._expected

    def _tear(self, content: bytes) -> bytes:
        return content[: self._generator.randrange(len(content))]

    def _flip(self, content: bytes) -> bytes:
        place = self._generator.randrange(len(content))
        return content[:place] + bytes([content[place] ^ 0x10]) + content[place + 1 :]

    def _disk_full(self) -> bool:
        """Limit the size of files, so that a write fails halfway as on a full disk."""
        self._set_workers(1)
        limit = (FILE_LIMIT, resource.RLIM_INFINITY)
        full = self._run(*TRAIN, before=partial(resource.setrlimit, resource.RLIMIT_FSIZE, limit))
        is_clear = full.returncode == 1 and "error: [Errno 27] File too large" in full.stdout
        done = self._run(*TRAIN)
        self._set_workers(0)
        is_whole = done.returncode == 0 and self._digest() == self._expected
        return is_clear and "Traceback" not in full.stdout and is_whole

    def _worker_death(self) -> bool:
        """Kill a worker; its seed must resume in another."""
        process = self._start_training()
        projects.await_checkpoint(self._project, AGENT, process)
        time.sleep(self._generator.uniform(0, 1))
        everybody = projects.family(process)
        workers = [one for one in everybody if "spawn_main" in projects.command_line(one)]
        if workers:
            projects.kill([self._generator.choice(workers)])
        return process.wait() == 0 and self._digest() == self._expected

    def _mlflow_down(self) -> bool:
        """Give MLflow an address where nothing listens."""
        done = self._run(*TRAIN, MLFLOW_TRACKING_URI=f"http://127.0.0.1:{_free_port()}")
        return done.returncode == 0 and self._digest() == self._expected

    def _mlflow_slow(self) -> bool:
        """Give MLflow the address of a server that never answers."""
        with socket.create_server(("127.0.0.1", 0)) as server:
            uri = f"http://127.0.0.1:{server.getsockname()[1]}"
            done = self._run(*TRAIN, MLFLOW_TRACKING_URI=uri)
        return done.returncode == 0 and self._digest() == self._expected

    def _mlflow_wiped(self) -> bool:
        """Delete MLflow's database."""
        self._run(*TRAIN)
        self._run(*TRACK)
        before = self._points()
        (self._project.folder / "mlflow.db").unlink()
        done = self._run(*TRACK)
        return done.returncode == 0 and self._points() == before != {}

    def _mlflow_half_written(self) -> bool:
        """Kill `track` at a random time; the next call must complete its work."""
        self._run(*TRAIN)
        (self._project.folder / "mlflow.db").unlink(missing_ok=True)
        process = projects.start(self._project, *TRACK, log=self._log)
        try:
            process.wait(self._generator.uniform(2, 8))
        except subprocess.TimeoutExpired:
            projects.kill(projects.family(process))
        first, second = self._run(*TRACK), self._run(*TRACK)
        has_all = set(self._points()) == {f"{AGENT}-seed-{seed}" for seed in projects.SEEDS}
        is_stable = "created" not in second.stdout and "repaired" not in second.stdout
        return first.returncode == second.returncode == 0 and has_all and is_stable

    def _run_left_running(self) -> bool:
        """Kill a training and its follower; `track` must close the runs they left."""
        process = self._start_training()
        deadline = time.monotonic() + SECONDS_TO_WAIT
        while "RUNNING" not in self._statuses() and time.monotonic() < deadline:
            if process.poll() is not None:
                break
            time.sleep(0.05)
        projects.kill(projects.family(process))
        was_left = "RUNNING" in self._statuses()
        done = self._run(*TRACK)
        statuses = self._statuses()
        is_closed = "RUNNING" not in statuses and ("KILLED" in statuses or not was_left)
        return done.returncode == 0 and is_closed

    def _two_pipelines_one_store(self) -> bool:
        """Train two projects at once into one database."""
        other = Checkout(self._project.folder.with_name("other"))
        shutil.rmtree(other.folder, ignore_errors=True)
        copy_project(other.folder)
        projects.prepare(other)
        database = self._project.folder.with_name("shared.db")
        database.unlink(missing_ok=True)
        uri = f"sqlite:///{database}"
        pair = (self._project, other)
        for command in (TRAIN, TRACK):
            processes = [
                projects.start(project, *command, log=self._log, MLFLOW_TRACKING_URI=uri)
                for project in pair
            ]
            codes = [process.wait() for process in processes]
        for project in pair:  # what one could not write while the other did
            codes.append(self._run(*TRACK, project=project, MLFLOW_TRACKING_URI=uri).returncode)
        rows = [
            len((self._model_folder(seed) / "curve.csv").read_text(encoding="utf-8").splitlines())
            - 1
            for seed in projects.SEEDS
        ]
        points = self._points(database).values()
        return not any(codes) and all(count >= min(rows) for count in points) and bool(points)

    def _diverging_simulation(self) -> bool:
        """Make one robot of a batch diverge; the others must not be affected."""
        world = World(robot.read(self._project.folder), projects.settings().env)
        rng = np.random.default_rng(self._generator.randrange(2**31))
        victim = int(rng.integers(4))
        torques = rng.uniform(-1, 1, (20, 4, 8))
        hurt, calm = (RobotVectorEnv(world, 4, threads) for threads in (1, 2))
        for envs in (hurt, calm):
            envs.reset(seed=7)
        bad = float(rng.choice([np.nan, np.inf, 1e300]))
        others = np.arange(4) != victim
        for step, row in enumerate(torques):
            if step == 10:
                hurt.qvel[victim, int(rng.integers(14))] = bad
            observations, rewards, terminations, _, _ = hurt.step(row)
            their_observations, their_rewards, their_terminations, _, _ = calm.step(row)
            if step == 10 and not terminations[victim]:
                return False
            is_same = (
                (observations == their_observations)[others].all()
                and (rewards == their_rewards)[others].all()
                and (terminations == their_terminations)[others].all()
            )
            if not (is_same and np.isfinite(observations).all() and np.isfinite(rewards).all()):
                return False
        return True

    def _points(self, database: Path | None = None) -> dict[str, int]:
        """Return how many curve points MLflow has for the run of each policy.

        Runs of killed trainings are excluded: they have the same names and fewer points. So is the
        machine's load, which cannot be restored. Seconds that were measured again count once.
        """
        return dict(
            self._query(
                "SELECT name, count(DISTINCT key || step) FROM metrics JOIN runs USING (run_uuid) "
                "WHERE lifecycle_stage = 'active' AND status = 'FINISHED' AND name LIKE ? "
                "AND key NOT LIKE 'system/%' GROUP BY run_uuid",
                f"{AGENT}-seed-%",
                path=database,
            )
        )

    def _statuses(self) -> set[str]:
        return {str(row[0]) for row in self._query("SELECT status FROM runs")}

    def _query(self, sql: str, *values: str, path: Path | None = None) -> list[Any]:
        path = path or self._project.folder / "mlflow.db"
        if not path.exists():
            return []
        with _database(path) as database:
            try:
                return database.execute(sql, values).fetchall()
            except sqlite3.OperationalError:  # its tables are not there yet
                return []


@contextmanager
def _database(path: Path) -> Iterator[sqlite3.Connection]:
    database = sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=30)
    try:
        yield database
    finally:
        database.close()


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port: int = server.getsockname()[1]
        return port
