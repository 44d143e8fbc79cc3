"""A clone in which a person ran everything on tiny budgets and committed it, as README.md says."""

import json
import os
import shlex
import subprocess
from dataclasses import dataclass
from pathlib import Path

from ruamel.yaml import YAML

from jumping_ant.base.files import digest
from jumping_ant.sim.gl import DISPLAYS
from scripts.checkout import RESULTS, Checkout, copy_project

RUN = "dvc exp run $(cat presets/smoke)"
COMMIT = 'git add -A && git commit -m "My run"'
BACK = "git stash -u && dvc checkout"


@dataclass(frozen=True)
class State:
    """Digests, by path, of the parameters and all outputs, and of DVC's cache."""

    files: dict[str, str]
    objects: dict[str, str]

    def changes(self, earlier: "State") -> list[str]:
        """Return the files that differ from earlier, and the objects that are changed or gone."""
        changed = self.files.items() ^ earlier.files.items()
        return sorted(dict(changed | (earlier.objects.items() - self.objects.items())))


class Project(Checkout):
    """A clone of the project, with commands run in it."""

    @property
    def environment(self) -> dict[str, str]:
        """Without the user's settings, and without a display or a browser."""
        home = str(self.folder.parent / "home")
        kept = {name: it for name, it in super().environment.items() if name not in DISPLAYS}
        kept |= {"XDG_CONFIG_HOME": home, "XDG_DATA_HOME": home}
        return kept | {"BROWSER": "true", "GIT_CONFIG_GLOBAL": os.devnull}

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
        text = (self.folder / "params.yaml").read_text(encoding="utf-8")
        self.write_params(YAML(typ="safe").load(text) | blocks)


def finish(folder: Path) -> Project:
    """Copy the project into a folder, run everything, and commit it on the branch `main`."""
    copy_project(folder)
    path = folder / "dvc.lock"  # of one agent's stages: DVC reads and writes it after each stage
    lock = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    lock["stages"] = {name: it for name, it in lock["stages"].items() if name.endswith("@dqn")}
    with path.open("w", encoding="utf-8") as file:
        YAML().dump(lock, file)
    for path in (folder / "results" / "tuning").iterdir():  # MLflow gets a run for each trial
        if path.stem != "dqn":
            path.unlink()
    project = Project(folder)
    project.type("git checkout -qb main && git add -A && git commit -qm Start")
    project.type(RUN)
    project.type(COMMIT)
    return project


def _digests(root: Path, *names: str) -> dict[str, str]:
    """Return the SHA-256 of files and of all files in folders, by path from the root."""
    paths = [path for name in names for path in (root / name, *(root / name).rglob("*"))]
    kept = [path for path in paths if path.is_file() and path.name != ".gitignore"]  # DVC's
    return {str(path.relative_to(root)): digest(path) for path in kept}
