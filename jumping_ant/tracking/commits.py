"""What `dvc.lock` says was run: that of the project, and that of its commit in git."""

import hashlib
import subprocess
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml.error import YAMLError

from jumping_ant.base.files import read_bytes
from jumping_ant.base.paths import Paths
from jumping_ant.params import inputs, params_file

# Parameters of a stage that it does not matter to who reads: seeds are looked for one by one.
APART = ("seeds", "record.fps")


class Locked(NamedTuple):
    """The stages of a `dvc.lock`, beside the parameters of the project."""

    root: Path
    stages: Mapping[str, Any]
    params: Any
    commit: str = ""  # that holds it, if it is that of a commit

    def holds(self, stage: str, *outputs: Path) -> bool:
        """Tell whether a stage ran with the project's parameters, and wrote these files or none."""
        entry = self.stages[stage]
        ran_with = entry.get("params", {}).get("params.yaml", {}).items()
        wrote = {it["path"]: it.get("md5") for it in entry.get("outs", ())}
        return all(
            name in APART or inputs.value(self.params, name) == it for name, it in ran_with
        ) and all(
            wrote.get(str(path.relative_to(self.root)), "") == _md5(path)
            for path in outputs
            if path.is_file()
        )

    def allows(self, stage: str, *outputs: Path) -> bool:
        """Tell whether nothing is known against it that a stage `holds` files."""
        return stage not in self.stages or self.holds(stage, *outputs)

    def commit_of(self, written: Mapping[str, Iterable[Path]]) -> str | None:
        """Return the commit if it holds all that stages wrote."""
        is_its = all(it in self.stages and self.holds(it, *paths) for it, paths in written.items())
        return self.commit if self.commit and is_its else None


def workspace(root: Path) -> Locked:
    """Read the `dvc.lock` of a project; before its first run there is none."""
    path = Paths(root).lock
    return _parsed(root, read_bytes(path, "").decode(errors="replace") if path.exists() else "")


def head(root: Path) -> Locked:
    """Read the `dvc.lock` in the commit of a project; a repository around it has none of it."""
    shown = _git(root, "show", "HEAD:./dvc.lock")
    return _parsed(root, shown)._replace(commit=_git(root, "rev-parse", "HEAD").strip())


def _git(root: Path, *arguments: str) -> str:
    """Return what git prints, nothing if it fails."""
    command = ["git", "-C", str(root), *arguments]
    try:
        return subprocess.run(command, capture_output=True, encoding="utf-8", check=True).stdout
    except (OSError, ValueError, subprocess.CalledProcessError):
        return ""


def _parsed(root: Path, text: str) -> Locked:
    """Read a lock; one that DVC has not written is none."""
    try:
        stages = {name: dict(entry) for name, entry in params_file.parse(text)["stages"].items()}
        for entry in stages.values():
            _ = entry.get("params", {}).get("params.yaml", {}).items()
            _ = [it["path"] for it in entry.get("outs", ())]
    except (YAMLError, RecursionError, LookupError, TypeError, ValueError, AttributeError):
        stages = {}
    return Locked(root, stages, params_file.read(Paths(root).params))


def _md5(path: Path) -> str:
    """Return the MD5 of a file, its key in DVC."""
    return hashlib.md5(path.read_bytes(), usedforsecurity=False).hexdigest()
