"""A copy of the project, in which its commands run apart from it; benchmarks throw theirs away."""

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from ruamel.yaml import YAML

from jumping_ant.base import telemetry
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.experiment.models import Params

RESULTS = ("assets", "dvc.lock", "media", "models", "results")  # what runs leave


@dataclass(frozen=True)
class Checkout:
    """A copy of the project as git would show it to someone else, nothing trained.

    Attributes:
        folder: Where it is.
    """

    folder: Path

    @property
    def environment(self) -> dict[str, str]:
        """The variables of its commands; its MLflow is its own."""
        variables = with_tools()
        variables.pop("MLFLOW_TRACKING_URI", None)
        return variables

    def write_params(self, params: Params) -> None:
        """Make other parameters its `params.yaml`."""
        with (self.folder / "params.yaml").open("w") as file:
            YAML().dump(params.model_dump(), file)

    def seconds(self, *command: str) -> float:
        """Run a command in it and return its wall-clock time [s].

        Raises:
            RuntimeError: It failed.
        """
        started = time.perf_counter()
        done = subprocess.run(
            command, cwd=self.folder, env=self.environment, text=True, capture_output=True
        )
        seconds = time.perf_counter() - started
        if done.returncode:
            raise RuntimeError(f"{shlex.join(command)} failed:\n{done.stdout}{done.stderr}")
        return seconds


def with_tools() -> dict[str, str]:
    """Return this process's variables, changed so that commands find this Python's tools first."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return os.environ | telemetry.SWITCHES | {"PATH": path}


@contextmanager
def checkout() -> Iterator[Checkout]:
    """Copy the project, and delete the copy in the end."""
    with tempfile.TemporaryDirectory() as parent:
        folder = Path(parent) / "project"
        copy_project(folder)
        yield Checkout(folder)


def copy_project(folder: Path) -> None:
    """Make a repository of what git tracks or would track."""
    _copy(_names(), folder)
    subprocess.run(["git", "init", "-q"], cwd=folder, check=True)


def renew_project(folder: Path) -> None:
    """Make a repository of the project's code, or renew the code of one made before.

    What its runs left stays: DVC reruns the stages that the new code touches, and trainings
    resume from their checkpoints where these fit.
    """
    names = [name for name in _names() if name.split("/")[0] not in RESULTS]
    for top in {name.split("/")[0] for name in names if "/" in name and not name.startswith(".")}:
        shutil.rmtree(folder / top, ignore_errors=True)  # with what is there no longer
    _copy(names, folder)
    subprocess.run(["git", "init", "-q"], cwd=folder, check=True)


def _names() -> list[str]:
    """Return what git tracks or would track, as paths from the project's root."""
    listing = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(listing, cwd=PROJECT_ROOT, text=True, capture_output=True, check=True)
    listed = filter(None, names.stdout.split("\0"))
    return [name for name in listed if (PROJECT_ROOT / name).is_file()]  # not deleted since


def _copy(names: Iterable[str], folder: Path) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(PROJECT_ROOT / name, folder / name)
