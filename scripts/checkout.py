"""A copy of the project, in which its commands run in isolation; benchmarks delete theirs."""

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
from typing import Any

from ruamel.yaml import YAML

from jumping_ant.base import command_line
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.params.model import Params

RESULTS = ("assets", "dvc.lock", "media", "models", "results")  # outputs of runs
NAME_YOURSELF = 'git config --global user.name "NAME" && git config --global user.email ADDRESS'


@dataclass(frozen=True)
class Checkout:
    """A copy of the project as someone else would check it out, with nothing trained."""

    folder: Path

    @property
    def environment(self) -> dict[str, str]:
        """The environment variables of its commands; runs go to its embedded MLflow store."""
        return {name: it for name, it in with_tools().items() if name != "MLFLOW_TRACKING_URI"}

    def write_params(self, params: Params | dict[str, Any]) -> None:
        """Write other parameters, or what they hold, to its `params.yaml`."""
        content = params.model_dump() if isinstance(params, Params) else params
        with (self.folder / "params.yaml").open("w", encoding="utf-8") as file:
            YAML().dump(content, file)

    def seconds(self, *command: str) -> float:
        """Run a command that must succeed in it; return its wall-clock time [s]."""
        started = time.perf_counter()
        done = self.run(*command)
        seconds = time.perf_counter() - started
        if done.returncode:
            raise RuntimeError(f"{shlex.join(command)} failed:\n{done.stdout}{done.stderr}")
        return seconds

    def run(self, *command: str) -> subprocess.CompletedProcess[str]:
        """Run a command in it; return its exit status and output."""
        return subprocess.run(
            command, cwd=self.folder, env=self.environment, encoding="utf-8", capture_output=True
        )


def with_tools() -> dict[str, str]:
    """Return this process's environment variables, with this Python's tools first in the path."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return os.environ | command_line.TELEMETRY | {"PATH": path}


@contextmanager
def checkout() -> Iterator[Checkout]:
    """Copy the project, and delete the copy at the end."""
    with tempfile.TemporaryDirectory() as parent:
        folder = Path(parent) / "project"
        copy_project(folder)
        yield Checkout(folder)


def copy_project(folder: Path) -> None:
    """Create a repository of the files that git tracks or would track."""
    _copy(project_files(), folder)


def renew_project(folder: Path) -> None:
    """Create a repository of the project's code, or update its code and keep its outputs."""
    names = [name for name in project_files() if name.split("/")[0] not in RESULTS]
    for top in {name.split("/")[0] for name in names if "/" in name and not name.startswith(".")}:
        shutil.rmtree(folder / top, ignore_errors=True)  # with files that no longer exist
    _copy(names, folder)


def project_files() -> list[str]:
    """Return what git tracks or would track, as paths from the project's root."""
    listed = git("ls-files", "-z", "--cached", "--others", "--exclude-standard").split("\0")
    return [name for name in listed if (PROJECT_ROOT / name).is_file()]  # not deleted since


def git(*arguments: str) -> str:
    """Return what git prints of the project.

    Raises:
        InputError: git refuses, as where the repository is not this user's.
    """
    done = subprocess.run(
        ["git", *arguments], cwd=PROJECT_ROOT, encoding="utf-8", capture_output=True
    )
    if done.returncode:
        reason = " ".join(done.stderr.split()) or f"git {shlex.join(arguments)} fails"
        raise InputError(f"{PROJECT_ROOT}: {reason}; without a repository, run `git init` there")
    return done.stdout


def warn_of_no_name() -> None:
    """Say how to name oneself to git, if nobody has: experiments of DVC are commits."""
    try:
        for key in ("user.name", "user.email"):
            git("config", key)
    except InputError:
        print(f"git knows no name, without which `dvc exp run` stops: {NAME_YOURSELF}", flush=True)


def _copy(names: Iterable[str], folder: Path) -> None:
    """Copy files into a folder, which becomes a repository."""
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(PROJECT_ROOT / name, folder / name)  # with its time, by which make decides
    subprocess.run(["git", "init", "-q"], cwd=folder, check=True)
