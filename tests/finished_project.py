"""A clone in which a person ran everything on tiny budgets and committed it, as README.md says."""

import json
import os
import shlex
import subprocess
from dataclasses import dataclass
from pathlib import Path

from ruamel.yaml import YAML

from jumping_ant.base.files import digest
from scripts.checkout import RESULTS, Checkout, copy_project
from scripts.view import DISPLAYS

RUN = "dvc exp run $(cat presets/smoke)"
COMMIT = 'git add -A && git commit -m "My run"'
BACK = "git stash -u && dvc checkout"


@dataclass(frozen=True)
class State:
    """Digests of what a command may not lose, by path."""

    files: dict[str, str]  # the parameters and all outputs
    objects: dict[str, str]  # DVC's cache

    def changes(self, earlier: "State") -> list[str]:
        """Return the files that differ from earlier, and the objects that are changed or gone."""
        files = {name for name, _ in self.files.items() ^ earlier.files.items()}
        objects = {name for name, _ in earlier.objects.items() - self.objects.items()}
        return sorted(files | objects)


class Project(Checkout):
    """A clone of the project, with commands run in it."""

    @property
    def environment(self) -> dict[str, str]:
        """Without the user's settings, and without a display or a browser."""
        home = str(self.folder.parent / "home")
        own = {"XDG_CONFIG_HOME": home, "XDG_DATA_HOME": home, "BROWSER": "true"}
        inherited = super().environment.items()
        shared = {name: value for name, value in inherited if name not in DISPLAYS}
        return shared | own | {"GIT_CONFIG_GLOBAL": os.devnull}

    def run(self, *command: str, check: bool = True) -> subprocess.CompletedProcess[str]:
        done = super().run(*command)
        if check and done.returncode:
            raise AssertionError(f"{shlex.join(command)}\n{done.stdout}\n{done.stderr}")
        return done

    def type(self, line: str, check: bool = True) -> subprocess.CompletedProcess[str]:
        """Run a line as a person types it."""
        return self.run("bash", "-c", line, check=check)

    def go_back(self) -> None:
        """Return to the commit."""
        self.type(BACK)

    def stale(self) -> set[str]:
        """Return the stages that a `dvc repro` would look at again."""
        return set(json.loads(self.run("dvc", "status", "--json").stdout))

    def state(self) -> State:
        outputs = _digests(self.folder, "params.yaml", *RESULTS)
        return State(outputs, _digests(self.folder / ".dvc" / "cache", "files"))

    def change_params(self, **blocks: object) -> None:
        """Replace blocks of `params.yaml`."""
        path = self.folder / "params.yaml"
        settings = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
        with path.open("w", encoding="utf-8") as file:
            YAML().dump(settings | blocks, file)


def finish(folder: Path) -> Project:
    """Copy the project into a folder, run everything, and commit it on the branch `main`."""
    copy_project(folder)
    _shorten_lock(folder / "dvc.lock")
    for path in (folder / "results" / "tuning").iterdir():  # MLflow gets a run for each trial
        if path.stem != "dqn":
            path.unlink()
    project = Project(folder)
    project.type("git checkout -qb main && git add -A && git commit -qm Start")
    project.type(RUN)
    project.type(COMMIT)
    return project


def _shorten_lock(path: Path) -> None:
    """Leave one agent's stages, as DVC reads and writes all of them after each stage."""
    lock = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    lock["stages"] = {name: own for name, own in lock["stages"].items() if name.endswith("@dqn")}
    with path.open("w", encoding="utf-8") as file:
        YAML().dump(lock, file)


def _digests(root: Path, *names: str) -> dict[str, str]:
    """Return the SHA-256 of all files below some folders and files, by path from the root."""
    tops = [root / name for name in names]
    files = [top for top in tops if top.is_file()]
    files += [path for top in tops for path in top.rglob("*") if path.is_file()]
    kept = [path for path in files if path.name != ".gitignore"]  # DVC renews these
    return {str(path.relative_to(root)): digest(path) for path in kept}
