"""Faults in files, in input, and in what surrounds a run: its end, its folder, its other users."""

import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from jumping_ant.base.archive import Archive, from_array, pack, pack_state
from jumping_ant.training.checkpoints import Saved
from scripts.checkout import Checkout, copy_project
from soak import project as projects
from soak.injector import AGENT, TRACK, TRAIN, Injector

REPRO = ("dvc", "repro", "--single-item", f"train@{AGENT}")
BUILD = (sys.executable, "-m", "stages.build")
EVALUATE = (sys.executable, "-m", "stages.evaluate", AGENT)
RECORD = (sys.executable, "-m", "stages.record", AGENT)
FILM_LIMIT = 20_000  # [bytes], less than a film has
MOST_BYTES = 6 * 2**30  # of address space, for a stage that refuses its input
LAUGHS = "a0: &a0 [0]\n" + "".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 10)
)
ROBOT = '<mujoco>{}<worldbody><body name="torso"><geom size="1"/></body></worldbody></mujoco>'


class FileFaults(Injector):
    """Faults in files and in what surrounds a run."""

    def _faults(self) -> Mapping[str, Callable[[], bool]]:
        policy = f"models/{AGENT}/seed-0/policy.zip"
        return {
            "commit_fails": self._commit_fails,
            "interrupt": self._interrupt,
            "follower_killed": self._follower_killed,
            "linked_outputs": self._linked_outputs,
            "litter": self._litter,
            "umask": self._umask,
            "odd_folder": self._odd_folder,
            "temporary_experiment": self._temporary_experiment,
            "other_parameters": self._other_parameters,
            "wrong_checkpoint": self._wrong_checkpoint,
            "wrong_finished_seed": partial(self._bad_finished_seed, _with_wrong_content),
            "torn_finished_seed": partial(self._bad_finished_seed, _torn),
            "film_cut": self._film_cut,
            "policy_bomb": partial(self._bad_file, policy, self._bomb, EVALUATE),
            "policy_not_finite": partial(self._bad_file, policy, self._not_finite, EVALUATE),
            "policy_of_later_format": partial(self._bad_file, policy, self._later, EVALUATE),
            "yaml_bomb": partial(self._bad_file, "params.yaml", lambda _: LAUGHS.encode(), BUILD),
            "robot_bomb": partial(self._bad_robot, '<size memory="100G"/>'),
            "robot_includes": partial(self._bad_robot, '<include file="/etc/hostname"/>'),
            "memory_too_small": self._memory_too_small,
            "mlflow_locked": self._mlflow_locked,
            "mlflow_driver_missing": self._mlflow_driver_missing,
            "mlflow_model_replaced": partial(self._mlflow_changed, "serving.py"),
            "mlflow_artifact_lost": partial(self._mlflow_changed, "curve.csv"),
        }

    def _commit_fails(self) -> bool:
        """Have DVC fail after training; the next run must not train again."""
        config = self._project.folder / ".dvc" / "config.local"
        config.write_text("[cache]\n    dir = /dev/null/cache\n", encoding="utf-8")
        failed = self._run(*REPRO, "--force")
        config.unlink()
        # Without DVC's run cache, which may have an earlier, equal run.
        done = self._run(*REPRO, "--no-run-cache")
        is_kept = "done, " not in done.stdout  # as a seed says that is trained
        return failed.returncode != 0 and is_kept and self._is_as_expected(done)

    def _interrupt(self) -> bool:
        """Press Ctrl-C at any time; the stage says so in a line, and the next run resumes."""
        process = self._start_training()
        time.sleep(self._generator.uniform(0, 8))
        length = len(self._log.read_text(encoding="utf-8"))
        os.killpg(process.pid, signal.SIGINT)
        process.wait()
        told = self._log.read_text(encoding="utf-8")[length:]
        return "Traceback" not in told and self._is_as_expected(self._run(*TRAIN))

    def _follower_killed(self) -> bool:
        """Kill the process that mirrors curves to MLflow; training must not notice."""
        process = self._start_training()
        projects.await_checkpoint(self._project, AGENT, process)
        everybody = projects.family(process)
        projects.kill([one for one in everybody if "follow" in projects.command_line(one)])
        is_trained = process.wait() == 0 and self._digest() == self._expected
        return is_trained and self._run(*TRACK).returncode == 0

    def _linked_outputs(self) -> bool:
        """Link outputs to a cache, as DVC can; what is in the cache must stay."""
        cached = self._project.folder / "cached"
        for path in list((self._project.folder / "models" / AGENT).rglob("*.*")):
            path.unlink()
            cached.write_text("cached", encoding="utf-8")
            path.symlink_to(cached)
        done = self._run(*TRAIN)
        return cached.read_text(encoding="utf-8") == "cached" and self._is_as_expected(done)

    def _litter(self) -> bool:
        """Leave what a killed write leaves; DVC must not see it, the next write removes it."""
        self._run("dvc", "repro", "build")
        litter = self._project.folder / "assets" / ".edited.xml.999999.new.tmp"
        litter.write_text("half", encoding="utf-8")
        is_unseen = "up to date" in self._run("dvc", "status", "build").stdout
        return is_unseen and self._run(*BUILD).returncode == 0 and not litter.exists()

    def _umask(self) -> bool:
        """Train for a user who lets nobody else read."""
        done = self._run(*TRAIN, before=partial(os.umask, 0o077))
        modes = {path.stat().st_mode & 0o077 for path in self._model_folder(0).iterdir()}
        return modes == {0} and self._is_as_expected(done)

    def _odd_folder(self) -> bool:
        """Train and track in a folder with an odd name."""
        other = Checkout(self._project.folder.with_name("a ?#% 'folder' \"x\""))
        shutil.rmtree(other.folder, ignore_errors=True)
        copy_project(other.folder)
        other.write_params(projects.settings())
        codes = [self._run(*command, project=other).returncode for command in (BUILD, TRAIN, TRACK)]
        policies = [
            (folder / "models" / AGENT / "seed-0" / "policy.zip").read_bytes()
            for folder in (self._project.folder, other.folder)
        ]
        return codes == [0, 0, 0] and policies[0] == policies[1]

    def _temporary_experiment(self) -> bool:
        """Kill a training in a folder that is then deleted; here it must resume."""
        self._run(*TRAIN)
        self._forget()
        folder = self._project.folder / ".dvc" / "tmp" / "exps" / "soak"
        shutil.rmtree(folder, ignore_errors=True)
        copy_project(folder)
        shutil.copy(self._project.folder / "params.yaml", folder)
        shutil.copytree(self._project.folder / "assets", folder / "assets", dirs_exist_ok=True)
        process = projects.start(Checkout(folder), *TRAIN, log=self._log)
        projects.await_checkpoint(self._project, AGENT, process)
        projects.kill(projects.family(process))
        shutil.rmtree(folder)
        done = self._run(*TRAIN)
        is_resumed = "resumes from" in done.stdout or "trained before" in done.stdout
        return is_resumed and self._is_as_expected(done)

    def _other_parameters(self) -> bool:
        """Train with other parameters between a kill and the next run, which must resume."""
        process = self._start_training()
        projects.await_checkpoint(self._project, AGENT, process)
        projects.kill(projects.family(process))
        settings = projects.settings()
        training = settings.training.model_copy(update={"evaluations": 1})
        self._project.write_params(settings.model_copy(update={"training": training}))
        others = self._run(*TRAIN).returncode
        self._project.write_params(settings)
        done = self._run(*TRAIN)
        is_resumed = "resumes from" in done.stdout or "trained before" in done.stdout
        return others == 0 and is_resumed and self._is_as_expected(done)

    def _wrong_checkpoint(self) -> bool:
        """Give the newest checkpoint another content, with the right digest."""
        process = self._start_training()
        projects.await_checkpoint(self._project, AGENT, process, after=1)
        projects.kill(projects.family(process))
        for newest in projects.checkpoints(self._project, AGENT)[-1:]:
            newest.write_bytes(_with_wrong_content(newest))
        return self._is_as_expected(self._run(*TRAIN))

    def _bad_finished_seed(self, changed: Callable[[Path], bytes]) -> bool:
        """Change a finished seed; it must be trained again."""
        self._run(*TRAIN)
        for path in (self._project.folder / ".checkpoints" / AGENT).rglob("seed-0.finished"):
            path.write_bytes(changed(path))
        done = self._run(*TRAIN)
        return "not used" in done.stdout and self._is_as_expected(done)

    def _film_cut(self) -> bool:
        """Have the disk fill up while a film is encoded; the old film must stay."""
        self._run(*EVALUATE)
        self._run(*RECORD)
        film = self._project.folder / "media" / f"{AGENT}.mp4"
        before = film.read_bytes()
        limit = (FILM_LIMIT, resource.RLIM_INFINITY)
        full = self._run(*RECORD, before=partial(resource.setrlimit, resource.RLIMIT_FSIZE, limit))
        is_clear = full.returncode == 1 and "Traceback" not in full.stdout
        return is_clear and film.read_bytes() == before and len(before) > FILM_LIMIT

    def _bad_file(
        self, name: str, change: Callable[[bytes], bytes], command: tuple[str, ...]
    ) -> bool:
        """Give a stage a changed file, and little memory; it must be refused in one line."""
        self._run(*TRAIN)
        with _changed(self._project.folder / name, change):
            return self._is_refused(*command)

    def _bad_robot(self, part: str) -> bool:
        """Give `build` a robot that asks for what none needs."""
        path = self._project.folder / "robots" / "bad.xml"
        path.write_text(ROBOT.format(part), encoding="utf-8")
        settings = projects.settings()
        own = settings.robot.model_copy(update={"source": "robots/bad.xml"})
        self._project.write_params(settings.model_copy(update={"robot": own}))
        is_refused = self._is_refused(*BUILD)
        self._project.write_params(settings)
        path.unlink()
        return is_refused

    def _memory_too_small(self) -> bool:
        """Ask for more memory than any machine has; training must not begin."""
        settings = projects.settings()
        large = settings.agent("sac").model_copy(update={"buffer_size": 10**9})
        agents = {**settings.agents, "sac": large}
        self._project.write_params(settings.model_copy(update={"agents": agents}))
        is_refused = self._is_refused(sys.executable, "-m", "stages.train", "sac")
        self._project.write_params(settings)
        return is_refused

    def _mlflow_locked(self) -> bool:
        """Hold MLflow's database; training must not notice, and `track` must say so."""
        self._run(*TRACK)
        holder = "import sqlite3, sys; c = sqlite3.connect('mlflow.db', timeout=30)\n"
        holder += "c.execute('BEGIN EXCLUSIVE'); print('held', flush=True); sys.stdin.read()"
        with subprocess.Popen(
            [sys.executable, "-c", holder],
            cwd=self._project.folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        ) as process:
            assert process.stdout and process.stdout.readline() == b"held\n"
            trained, tracked = self._run(*TRAIN), self._run(*TRACK)
            process.kill()
        is_told = tracked.returncode == 2 and "in use by another program" in tracked.stdout
        return is_told and self._is_as_expected(trained) and self._run(*TRACK).returncode == 0

    def _mlflow_driver_missing(self) -> bool:
        """Name a database whose driver is not installed, with a password."""
        uri = "postgresql://me:secret@127.0.0.1/x"
        trained = self._run(*TRAIN, MLFLOW_TRACKING_URI=uri)
        tracked = self._run(*TRACK, MLFLOW_TRACKING_URI=uri)
        told = trained.stdout + tracked.stdout
        is_clear = tracked.returncode == 2 and "secret" not in told and "Traceback" not in told
        return is_clear and self._is_as_expected(trained)

    def _mlflow_changed(self, name: str) -> bool:
        """Change a file that MLflow keeps; `track` must put it right."""
        (self._project.folder / "mlflow.db").unlink(missing_ok=True)
        shutil.rmtree(self._project.folder / "mlartifacts", ignore_errors=True)
        self._run(*TRAIN)  # other trainings left models that `track` does not look at
        self._run(*TRACK)
        place = self._project.folder / "mlartifacts"
        path = self._generator.choice(sorted(place.rglob(name)))
        content = path.read_bytes()
        path.write_bytes(content + b"# changed")
        done = self._run(*TRACK)
        return done.returncode == 0 and "repaired" in done.stdout and path.read_bytes() == content

    def _is_as_expected(self, done: subprocess.CompletedProcess[str]) -> bool:
        return done.returncode == 0 and self._digest() == self._expected

    def _is_refused(self, *command: str) -> bool:
        limit = (MOST_BYTES, MOST_BYTES)
        done = self._run(*command, before=partial(resource.setrlimit, resource.RLIMIT_AS, limit))
        lines = [line for line in done.stdout.splitlines() if line.startswith("error: ")]
        return done.returncode == 2 and len(lines) == 1 and "Traceback" not in done.stdout

    def _bomb(self, content: bytes) -> bytes:
        """Return the policy with a weight whose header says terabytes."""
        array = Archive(content)["weight.npy"]
        header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (999999, 999999), }"
        bomb = array[:10] + header.ljust(117) + b"\n" + array[128:]
        return pack({**Archive(content), "weight.npy": bomb})

    def _not_finite(self, content: bytes) -> bytes:
        weight = np.full((8, 27), np.nan, np.float32)
        return pack({**Archive(content), "weight.npy": from_array(weight)})

    def _later(self, content: bytes) -> bytes:
        header = Archive(content)["policy.json"].replace(b'"format": 3', b'"format": 4')
        return pack({**Archive(content), "policy.json": header})


def _torn(path: Path) -> bytes:
    return path.read_bytes()[:-9]


def _with_wrong_content(path: Path) -> bytes:
    wrong, owner = pack_state({"state": np.zeros(3)}), projects.owner_of(path)
    saved = Saved.from_bytes(path.read_bytes(), owner)
    return replace(saved, content=wrong, best=wrong).to_bytes(owner)


@contextmanager
def _changed(path: Path, change: Callable[[bytes], bytes]) -> Iterator[None]:
    before = path.read_bytes()
    path.unlink()
    path.write_bytes(change(before))
    try:
        yield
    finally:
        path.write_bytes(before)
