"""A copy of the project, in which its commands run in isolation; benchmarks delete theirs."""

import hashlib
import io
import os
import re
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
from jumping_ant.base.files import PROJECT_ROOT, digest, read_json, write_json
from jumping_ant.params.model import Params

PARAMS, DVC_CONFIG = "params.yaml", ".dvc/config"
RESULTS = ("assets", "dvc.lock", "media", "models", "results")  # outputs of runs
MOST_NAMED = 3
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
        (self.folder / PARAMS).write_text(_to_yaml(params), encoding="utf-8")

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


def renew_project(folder: Path, params: Params) -> None:
    """Create a repository of the project's code with parameters, or update an earlier call's.

    Outputs stay, DVC's settings, and whatever else somebody has put there.

    Raises:
        InputError: Somebody changed what an earlier call wrote; it stays as it is.
    """
    written = folder / ".dvc" / "tmp" / "preset.json"  # SHA-256 of what a call wrote, by path
    earlier: dict[str, str] = read_json(written, "") if written.exists() else {}
    names = {name for name in project_files() if name.split("/")[0] not in RESULTS}
    if (folder / DVC_CONFIG).exists():
        names.remove(DVC_CONFIG)
    text = _to_yaml(params)
    new = {name: digest(PROJECT_ROOT / name) for name in names - {DVC_CONFIG}}
    new[PARAMS] = hashlib.sha256(text.encode()).hexdigest()
    checked = earlier.keys() | new.keys() if earlier else {PARAMS}  # older copies have no list
    changed = [
        name
        for name in sorted(checked)
        if (folder / name).is_file()
        and digest(folder / name) not in (earlier.get(name), new.get(name))
    ]
    if changed:
        raise InputError(
            f"{folder}: {', '.join(changed[:MOST_NAMED])} changed since a preset was run there; "
            "`make repro` in that folder runs it as it is, and the preset replaces what you remove"
        )
    for name in earlier.keys() - new.keys():
        (folder / name).unlink(missing_ok=True)
    _copy(names - {PARAMS}, folder)
    Checkout(folder).write_params(params)
    write_json(written, new)


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


def _to_yaml(params: Params | dict[str, Any]) -> str:
    """Return parameters as YAML, of version 1.1 as well, which takes 1e-05 for text."""
    text = io.StringIO()
    YAML().dump(params.model_dump() if isinstance(params, Params) else params, text)
    written = re.sub(r"(?<=[ \[])(-?[0-9]+)(?=e[-+]?[0-9]+\b)", r"\1.0", text.getvalue())
    return f"# yaml-language-server: $schema=params.schema.json\n{written}"


def _copy(names: Iterable[str], folder: Path) -> None:
    """Copy files into a folder, which becomes a repository."""
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(PROJECT_ROOT / name, folder / name)  # with its time, by which make decides
    subprocess.run(["git", "init", "-q"], cwd=folder, check=True)
