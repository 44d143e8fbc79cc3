"""What a stage of `dvc.yaml` depends on, so that a change while it runs is no part of its results.

DVC notes a stage's dependencies when its command has ended, which may have loaded others before.
"""

import importlib.metadata
import os
import re
import tokenize
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import filterfalse
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml.error import YAMLError

from jumping_ant.base import effective_code
from jumping_ant.base.errors import InputError, told
from jumping_ant.base.files import PROJECT_ROOT, digest, read_json
from jumping_ant.base.paths import Paths
from jumping_ant.params import params_file

SMALL = 2**18  # [bytes]; of a larger file its size, time and number tell if it has changed
LEFTOVERS = re.compile(r"\..*|.*~|#.*#|4913|.*\.(orig|rej)|__pycache__|Thumbs\.db|desktop\.ini")
MOST_NAMED = 3  # of what has changed
AGAIN = "its results are not taken: run `dvc repro` again, which keeps finished seeds"


class Code(NamedTuple):
    """The state of a file of code."""

    digest: str  # of its text
    saved: int  # when [ns]
    effective: str  # digest of what it does


class Inputs(NamedTuple):
    """What a stage depends on, by name."""

    values: dict[str, Any]  # of parameters, and what tells files apart
    code: dict[str, Code]  # which does what `digest` digested
    listed: dict[str, str]  # digests of code, and versions of libraries


@contextmanager
def unchanged(stage: str, root: Path = PROJECT_ROOT) -> Iterator[None]:
    """Raise an InputError unless what a stage depends on is the same before and after (`read`)."""
    before = read(stage, root)
    yield
    after = _values(stage, root)
    names = [it for it in before.values | after if before.values.get(it) != after.get(it)]
    names += [name for name, code in before.code.items() if differs(root / name, code)]
    refuse(names, stage)
    require_versions(before.listed)


def refuse(names: Iterable[object], stage: str) -> None:
    """Raise an InputError that names what has changed while a stage ran, if anything has."""
    if found := list(map(str, names)):
        more = f" and {len(found) - MOST_NAMED} more" if len(found) > MOST_NAMED else ""
        line = f"{', '.join(found[:MOST_NAMED])}{more}: changed, or saved again, while {stage} ran"
        raise InputError(f"{line}; {AGAIN}")


def read(stage: str, root: Path = PROJECT_ROOT) -> Inputs:
    """Read what a stage depends on.

    Raises:
        InputError: Code is not what `digest` digested, or a library not of the version that it saw.
    """
    values, paths = _values(stage, root), Paths(root)
    listed: dict[str, str] = {}
    for file in (root / name for name in values if name.endswith(".json")):
        if paths.inputs in file.parents:
            listed |= read_json(file, "digest")
    whole = paths.code("files")
    seen = read_json(whole, "digest") if whole.is_file() else {}
    require_versions(listed)
    code = {}
    for name in filter(_is_file, listed):
        path = root / name
        text = digest(path) if path.is_file() else ""
        if text != seen.get(name) and _effective(path) != listed[name]:
            raise InputError(f"{name}: changed since this run digested the code; {AGAIN}")
        code[name] = Code(text, path.stat().st_mtime_ns, listed[name])
    return Inputs(values, code, listed)


def code_of(path: Path) -> Code:
    """Return the state of a file of code."""
    return Code(digest(path), path.stat().st_mtime_ns, effective_code.digest(path))


def differs(path: Path, before: Code) -> bool:
    """Tell if a file of code does something else than before, or was changed and changed back.

    Other comments are no difference. If a file has them in the end, nobody sees whether it did
    something else in between.
    """
    if not path.is_file():
        return True
    if path.stat().st_mtime_ns == before.saved:
        return False
    return digest(path) == before.digest or _effective(path) != before.effective


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


def value(content: Any, name: str) -> Any:
    """Return what a dotted name stands for in a params file; None if there is nothing."""
    for part in name.split("."):
        content = content.get(part) if isinstance(content, dict) else None
    return content


def _is_file(name: str) -> bool:
    return "/" in name


def _effective(path: Path) -> str:
    try:
        return effective_code.digest(path)
    except (OSError, SyntaxError, tokenize.TokenError, UnicodeError):  # half edited
        return ""


def _values(stage: str, root: Path) -> dict[str, Any]:
    """Return values of a stage's parameters, and what tells its files apart, by their names."""
    params = params_file.read(root / "params.yaml")
    try:
        parameters, files = _dependencies(stage, root, params)
    except (YAMLError, LookupError, TypeError, AttributeError, UnicodeError) as error:
        raise InputError(f"dvc.yaml: has no stage {stage} ({told(error)})") from error
    values = {f"params.yaml: {name}": value(params, name) for name in parameters}
    return values | {str(file.relative_to(root)): _state(file) for file in files}


def _state(file: Path) -> object:
    status = file.stat()
    if status.st_size < SMALL:
        return digest(file)  # git may write it again, as when an experiment is queued
    return status.st_size, status.st_mtime_ns, status.st_ino


def _dependencies(stage: str, root: Path, params: Any) -> tuple[list[str], list[Path]]:
    """Return the names of a stage's parameters, and its files, as `dvc.yaml` lists them."""
    name, _, key = stage.partition("@")
    text = (root / "dvc.yaml").read_text(encoding="utf-8")
    definition = params_file.parse(text)["stages"][name]
    values = {"key": key}
    if key:
        item = value(params, f"{definition['foreach'][2:-1]}.{key}") or {}
        values |= {f"item.{name}": str(it) for name, it in item.items()}
        definition = definition["do"]

    def fill(text: str) -> str:
        return re.sub(r"\$\{([\w.]+)\}", lambda match: values.get(match[1], ""), text)

    parameters = list(map(fill, definition.get("params", [])))
    return parameters, [file for it in definition["deps"] for file in _files(root / fill(it))]


def _files(path: Path) -> Iterator[Path]:
    """Yield a file, or those of a folder, without what `.dvcignore` names."""
    if path.is_file():
        yield path
    for folder, folders, files in os.walk(path):
        folders[:] = filterfalse(LEFTOVERS.fullmatch, folders)
        kept = (Path(folder, name) for name in filterfalse(LEFTOVERS.fullmatch, files))
        yield from filter(Path.is_file, kept)
