"""What all kinds of faults share: a project, what training it gives, and counts.

A fault is survived if what it must not affect is the same as without it: mostly the bytes of the
models that are trained meanwhile or afterwards.
"""

import hashlib
import random
import shutil
import subprocess
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from scripts.checkout import Checkout
from soak import project as projects

AGENT = "pgpe"  # trains the fastest
TRAIN = (sys.executable, "-m", "stages.train", AGENT)
TRACK = (sys.executable, "-m", "stages.track")


@dataclass
class Count:
    """Times a fault was caused, and times it was survived."""

    injected: int = 0
    survived: int = 0


class Injector(ABC):
    """Causes faults in a project.

    Args:
        project: A throw-away copy that has been prepared.
        generator: Decides when and where faults occur.

    Attributes:
        counts: Counts of each fault, by name.
    """

    def __init__(self, project: Checkout, generator: random.Random) -> None:
        self._project = project
        self._generator = generator
        self._log = project.folder / "faults.log"
        self._set_workers(1)  # no processes to start; the bytes are the same
        self._run(*TRAIN)
        self._set_workers(0)
        self._expected = self._digest()
        self.counts = {name: Count() for name in self._faults()}

    def once(self, name: str) -> None:
        """Cause a fault, and count whether it was survived."""
        self._forget()
        self.counts[name].injected += 1
        self.counts[name].survived += self._faults()[name]()

    @abstractmethod
    def _faults(self) -> Mapping[str, Callable[[], bool]]:
        """Return functions that cause a fault and tell whether it was survived, by name."""

    def _start_training(self) -> subprocess.Popen[bytes]:
        return projects.start(self._project, *TRAIN, log=self._log)

    def _run(
        self,
        *command: str,
        project: Checkout | None = None,
        before: Callable[[], object] | None = None,
        **variables: str,
    ) -> subprocess.CompletedProcess[str]:
        """Run a command to its end; return both its streams as one, and append them to the log."""
        project = project or self._project
        done = subprocess.run(
            command,
            cwd=project.folder,
            env=project.environment | variables,
            encoding="utf-8",
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            preexec_fn=before,
        )
        with self._log.open("a", encoding="utf-8") as log:
            log.write(done.stdout)
        return done

    def _set_workers(self, workers: int) -> None:
        settings = projects.settings()
        compute = settings.compute.model_copy(update={"workers": workers})
        self._project.write_params(settings.model_copy(update={"compute": compute}))

    def _forget(self) -> None:
        """Delete the checkpoints, so that the next training starts from scratch."""
        shutil.rmtree(self._project.folder / ".checkpoints", ignore_errors=True)

    def _model_folder(self, seed: int) -> Path:
        return self._project.folder / "models" / AGENT / f"seed-{seed}"

    def _digest(self) -> str:
        """Return a digest of the agent's models."""
        whole = hashlib.sha256()
        for seed in projects.SEEDS:
            for path in sorted(self._model_folder(seed).iterdir()):
                whole.update(path.name.encode() + path.read_bytes())
        return whole.hexdigest()
