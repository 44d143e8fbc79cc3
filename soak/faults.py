"""Faults of what surrounds a training while it runs: a signal, its follower, its MLflow server.

A fault is survived if the models have the same bytes as without it.
"""

import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import time

from scripts.checkout import Checkout
from soak import project as projects
from soak.project import AGENT

TRAIN = (sys.executable, "-m", "stages.train", AGENT)
MOST_SECONDS = 8.0  # until a signal; a training takes about as long


class Faults:
    """Causes faults while a prepared project trains, and counts them by name."""

    def __init__(self, project: Checkout, generator: random.Random) -> None:
        self._project = project
        self._generator = generator
        self._log = project.folder / "faults.log"
        self._kinds = {
            "interrupt": self._interrupt,
            "follower_killed": self._follower_killed,
            "mlflow_slow": self._mlflow_slow,
        }
        self.counts = {name: {"injected": 0, "survived": 0} for name in self._kinds}
        project.seconds(*TRAIN)
        self._expected = projects.digests(project, AGENT)

    def once(self, name: str) -> None:
        """Train from scratch with a fault, and count whether it was survived."""
        shutil.rmtree(self._project.folder / ".checkpoints", ignore_errors=True)
        self._log.unlink(missing_ok=True)
        self.counts[name]["injected"] += 1
        after = 600 if name == "interrupt" else 0
        # Workers are for `soak.kills` to disturb.
        self._project.write_params(projects.settings(workers=1, live_after_seconds=after))
        is_done = self._kinds[name]()
        is_clear = "Traceback" not in self._log.read_text(encoding="utf-8")
        is_same = projects.digests(self._project, AGENT) == self._expected
        self._project.write_params(projects.settings())
        self.counts[name]["survived"] += is_done and is_clear and is_same

    def _interrupt(self) -> bool:
        """Press Ctrl-C at any time; the next run resumes."""
        process = self._train()
        time.sleep(self._generator.uniform(0, MOST_SECONDS))
        os.killpg(process.pid, signal.SIGINT)
        process.wait()
        return self._train().wait() == 0

    def _follower_killed(self) -> bool:
        """Kill the process that mirrors curves to MLflow; `track` completes its work."""
        process = self._train()
        projects.await_checkpoint(self._project, AGENT, process)
        everybody = projects.family(process)
        projects.kill([each for each in everybody if "follow" in projects.command_line(each)])
        is_trained = process.wait() == 0
        tracked = self._project.run(sys.executable, "-m", "stages.track")
        return is_trained and tracked.returncode == 0

    def _mlflow_slow(self) -> bool:
        """Give MLflow the address of a server that never answers."""
        with socket.create_server(("127.0.0.1", 0)) as server:
            uri = f"http://127.0.0.1:{server.getsockname()[1]}"
            return self._train(MLFLOW_TRACKING_URI=uri).wait() == 0

    def _train(self, **variables: str) -> subprocess.Popen[bytes]:
        return projects.start(self._project, *TRAIN, log=self._log, **variables)
