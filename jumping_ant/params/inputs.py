"""What a stage of `dvc.yaml` depends on, so that a change while it runs is no part of its results.

DVC notes a stage's dependencies when its command has ended, which may have loaded others before.
"""

import importlib.metadata
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import filterfalse
from pathlib import Path
from typing import Any, NamedTuple

from jumping_ant.base import effective_code
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT, digest, read_json
from jumping_ant.base.paths import Paths
from jumping_ant.params import params_file

MOST_NAMED = 3  # of what has changed
AGAIN = "run `dvc repro` again, which keeps finished seeds"


class Code(NamedTuple):
    """A file of code, which does what was digested."""

    digest: str  # of all its text
    saved: int  # when [ns]


@contextmanager
def unchanged(stage: str, root: Path = PROJECT_ROOT) -> Iterator[None]:
    """Raise an InputError unless what a stage depends on is the same before and after (`read`)."""
    before = read(stage, root)
    yield
    after = read(stage, root)
    names = [name for name in before | after if _differ(before.get(name), after.get(name))]
    if names:
        more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
        named = ", ".join(names[:MOST_NAMED]) + more
        raise InputError(f"{named}: changed while {stage} ran; its results are not taken: {AGAIN}")


def read(stage: str, root: Path = PROJECT_ROOT) -> dict[str, Any]:
    """Return values of a stage's parameters, and states of its files, each by its name.

    Raises:
        InputError: Code is not what `digest` digested, or a library not of the version that it saw.
    """
    paths = Paths(root)
    params = params_file.read(paths.params)
    parameters, files = _dependencies(stage, root, params)
    found = {f"params.yaml: {name}": value(params, name) for name in parameters}
    code: dict[str, str] = {}
    for file in files:
        status = file.stat()
        found[str(file.relative_to(root))] = status.st_size, status.st_mtime_ns, status.st_ino
        if file.suffix == ".json" and paths.inputs in file.parents:
            code |= read_json(file, "digest")
    seen = read_json(paths.code("files"), "digest") if code else {}
    require_versions(code)
    for name in filter(_is_file, code):
        found[name] = _code(root / name, name, code[name], seen.get(name))
    return found


def require_versions(code: Mapping[str, str]) -> None:
    """Raise an InputError if a library of a stage is not installed in the version that is locked.

    `code` are the stage's digests of files and versions of libraries, by name.
    """
    for library in filterfalse(_is_file, code):
        try:
            text = importlib.metadata.distribution(library).read_text("METADATA") or ""
        except importlib.metadata.PackageNotFoundError:
            continue  # whoever imports it says so
        # `version` would parse all of the text.
        (installed,) = re.findall(r"^Version: ([^+\s]+)", text, re.MULTILINE)[:1] or ("unknown",)
        if installed != code[library]:
            raise InputError(
                f"{library}: given version {installed}, which is installed, allowed: "
                f"{code[library]}, as in requirements.lock; `rm .venv/.packages; make install` "
                "installs it"
            )


def _is_file(name: str) -> bool:
    return "/" in name


def _code(path: Path, name: str, digested: str, seen: str | None) -> Code:
    """Return the state of a file of code, given digests of its effective and its whole text."""
    if path.is_file():
        state = Code(digest(path), path.stat().st_mtime_ns)
        if state.digest == seen or effective_code.digest(path) == digested:
            return state
    raise InputError(f"{name}: changed since this run digested the code; {AGAIN}")


def _differ(before: Any, after: Any) -> bool:
    """Tell if something has changed, or has been changed back; comments of code may change."""
    if isinstance(before, Code) and isinstance(after, Code) and before.digest != after.digest:
        return False
    return bool(before != after)


def _dependencies(stage: str, root: Path, params: Any) -> tuple[list[str], Iterator[Path]]:
    """Return the names of a stage's parameters, and its files, as `dvc.yaml` lists them."""
    name, _, key = stage.partition("@")
    text = (root / "dvc.yaml").read_text(encoding="utf-8")
    definition = params_file.parse(text)["stages"][name]
    values = {"key": key}
    if key:
        item = value(params, f"{definition['foreach'][2:-1]}.{key}") or {}
        values |= {f"item.{name}": str(value) for name, value in item.items()}
        definition = definition["do"]

    def fill(text: str) -> str:
        return re.sub(r"\$\{([\w.]+)\}", lambda match: values.get(match[1], ""), text)

    parameters = list(map(fill, definition.get("params", [])))
    return parameters, (file for it in definition["deps"] for file in _files(root / fill(it)))


def _files(path: Path) -> Iterator[Path]:
    """Yield a file, or those of a folder that DVC looks at."""
    if path.is_file():
        yield path
    for folder, folders, files in os.walk(path):
        folders[:] = [each for each in folders if each != "__pycache__" and each[0] != "."]
        yield from (Path(folder, each) for each in files if each[0] != ".")


def value(content: Any, name: str) -> Any:
    """Return what a dotted name stands for in a params file; None if there is nothing."""
    for part in name.split("."):
        content = content.get(part) if isinstance(content, dict) else None
    return content
