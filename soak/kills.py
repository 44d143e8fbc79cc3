"""Trainings killed at any moment, and run again until they finish.

Each must end with the same bytes as an uninterrupted one.
"""

import random
import shutil
import subprocess
import time

import psutil  # type: ignore[import-untyped]

from scripts.checkout import Checkout
from soak import project as projects

AFTER_A_CHECKPOINT = 0.8  # share of kills; much of a short training is its start
REPRO = ("dvc", "repro", "--single-item", "--no-run-cache")


class Killer:
    """Kills an agent's trainings, each up to `most` times; counts kills that changed no byte."""

    def __init__(
        self, project: Checkout, agent: str, generator: random.Random, most: int = 4
    ) -> None:
        self.count = {"killed": 0, "identical": 0}
        self.log = project.folder / f"{agent}.log"
        self._project = project
        self._agent = agent
        self._generator = generator
        self._most = most
        started = time.monotonic()
        process = self._repro(anew=True)
        projects.await_checkpoint(project, agent, process)
        first = time.monotonic()
        process.wait()
        self._seconds = time.monotonic() - started
        self._training_seconds = time.monotonic() - first
        self._expected = projects.digests(project, agent)

    def once(self) -> None:
        """Train once, with several kills on the way."""
        kills = 0
        wanted = self._generator.randint(1, self._most)
        while kills < wanted:
            process = self._repro(anew=not kills)
            try:
                process.wait(self._moment(process))
                break  # it finished before the kill
            except subprocess.TimeoutExpired:
                projects.kill(self._victims(process))
                process.wait()
                kills += 1
        else:
            process = self._repro()
            process.wait()
        if process.returncode:
            raise RuntimeError(f"train@{self._agent} fails after a kill; see {self.log}")
        is_same = projects.digests(self._project, self._agent) == self._expected
        self.count["killed"] += kills
        self.count["identical"] += kills if is_same else 0

    def _moment(self, process: subprocess.Popen[bytes]) -> float:
        """Return the seconds until the kill: mostly after a checkpoint, otherwise at any time."""
        if self._generator.random() > AFTER_A_CHECKPOINT:
            return self._generator.uniform(0, self._seconds)
        projects.await_checkpoint(self._project, self._agent, process)
        return self._generator.uniform(0, 0.4 * self._training_seconds)

    def _repro(self, *, anew: bool = False) -> subprocess.Popen[bytes]:
        """Start the agent's training, from its last checkpoints unless it is to begin anew."""
        if anew:
            shutil.rmtree(self._project.folder / ".checkpoints" / self._agent, ignore_errors=True)
        command = (*REPRO, *(["--force"] if anew else []), f"train@{self._agent}")
        return projects.start(self._project, *command, log=self.log)

    def _victims(self, process: subprocess.Popen[bytes]) -> list[psutil.Process]:
        """Return which processes to kill: all, or the training alone, whose end DVC then sees."""
        everybody = projects.family(process)
        if self._generator.random() < 0.5:
            return everybody
        trainings = [other for other in everybody if "stages.train" in projects.command_line(other)]
        return trainings[-1:] or everybody
