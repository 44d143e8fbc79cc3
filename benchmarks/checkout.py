"""A throw-away copy of the project, in which benchmarks run its commands."""

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from ruamel.yaml import YAML

from jumping_ant.files import PROJECT_ROOT
from jumping_ant.params import Params


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
    return os.environ | {"PATH": path, "DVC_NO_ANALYTICS": "true"}


@contextmanager
def checkout() -> Iterator[Checkout]:
    """Copy the project, and delete the copy in the end."""
    with tempfile.TemporaryDirectory() as parent:
        folder = Path(parent) / "project"
        copy_project(folder)
        yield Checkout(folder)


def copy_project(folder: Path) -> None:
    """Make a repository of what git tracks or would track."""
    listing = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(listing, cwd=PROJECT_ROOT, text=True, capture_output=True, check=True)
    for name in filter(None, names.stdout.split("\0")):
        if (PROJECT_ROOT / name).is_file():  # not deleted since
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(PROJECT_ROOT / name, folder / name)
    subprocess.run(["git", "init", "-q"], cwd=folder, check=True)
