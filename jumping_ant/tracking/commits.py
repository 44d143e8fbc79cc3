"""What `dvc.lock` says was run: that of the project, and that of its commit in git."""

import hashlib
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.params import inputs, params_file


class Locked(NamedTuple):
    """The stages of a `dvc.lock`, beside the parameters of the project."""

    stages: Mapping[str, Any]
    params: Any
    commit: str | None = None  # that holds it, if it is that of a commit

    def has_params_of(self, stage: str) -> bool:
        """Tell whether a stage ran with the parameters of the project, whatever its seeds."""
        blocks = self.stages.get(stage, {}).get("params", {})
        ran_with = blocks.get("params.yaml", {}).items()
        return all(
            name == "seeds" or inputs.value(self.params, name) == it for name, it in ran_with
        )

    def commit_of(self, stage: str, output: Path) -> str | None:
        """Return the commit if a stage wrote this output there, with the same parameters."""
        outputs = {it.get("md5") for it in self.stages.get(stage, {}).get("outs", ())}
        is_its = output.is_file() and _md5(output) in outputs and self.has_params_of(stage)
        return self.commit if is_its else None


def workspace(root: Path) -> Locked:
    """Read the `dvc.lock` of a project; before its first run there is none."""
    path = Paths(root).lock
    return _parse(root, path.read_text(encoding="utf-8") if path.exists() else "")


def head(root: Path) -> Locked:
    """Read the `dvc.lock` in the commit of a project; a repository around it has none of it."""
    shown = _git(root, "show", "HEAD:./dvc.lock")
    return _parse(root, shown)._replace(commit=_git(root, "rev-parse", "HEAD").strip() or None)


def _git(root: Path, *arguments: str) -> str:
    """Return what git prints, nothing if it fails."""
    command = ["git", "-C", str(root), *arguments]
    try:
        return subprocess.run(command, capture_output=True, encoding="utf-8", check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        return ""


def _parse(root: Path, text: str) -> Locked:
    try:
        content = YAML(typ="safe").load(text) or {}
    except YAMLError as error:
        raise InputError(f"dvc.lock: not YAML: {' '.join(str(error).split())}") from error
    return Locked(content.get("stages", {}), params_file.read(Paths(root).params))


def _md5(path: Path) -> str:
    """Return the MD5 of a file, its key in DVC."""
    return hashlib.md5(path.read_bytes(), usedforsecurity=False).hexdigest()
