"""Atomic writes, reads of stage outputs, and digests of files."""

import errno
import glob
import hashlib
import json
import os
import re
import shutil
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import Any, Literal

from jumping_ant.base.errors import InputError

CODE_ROOT = Path(__file__).resolve().parents[2]  # the folder that contains the library
# Errors of file systems that have no hard links, and of files that may not be linked.
NO_LINKS = (errno.EPERM, errno.EOPNOTSUPP, errno.EMLINK)
# The project that commands work on: the checkout or, if the library is installed from a wheel, the
# current folder.
PROJECT_ROOT = CODE_ROOT if (CODE_ROOT / "pyproject.toml").is_file() else Path.cwd()


def write_all(contents: Mapping[Path, bytes | str]) -> None:
    """Write files together: if one of them cannot be written, all stay as they were.

    Every file is written in full next to its path before the first one is put in place, so a
    reader sees the old content or the new, never a mix. A symbolic link is replaced, not followed:
    DVC may have linked the path to its cache. What a killed process left behind is removed.

    Args:
        contents: The whole content of each file, text as UTF-8; missing folders are created.

    Raises:
        OSError: A folder cannot be written to, or the disk is full; no file has changed.
    """
    for path in contents:
        path.parent.mkdir(parents=True, exist_ok=True)
        _remove_litter(path)
    with ExitStack() as undo:
        for path, content in contents.items():
            undo.callback(_beside(path, "new").unlink, missing_ok=True)
            _write_beside(path, content.encode() if isinstance(content, str) else content)
        for path in contents:
            undo.callback(_keep_old(path))
            os.replace(_beside(path, "new"), path)
        for folder in {path.parent for path in contents}:
            _sync_folder(folder)
        undo.pop_all()
    for path in contents:
        with suppress(OSError):  # the next write removes it
            _beside(path, "old").unlink(missing_ok=True)


def _write_beside(path: Path, content: bytes) -> None:
    """Write a file's new content next to it, and flush it to disk."""
    _beside(path, "new").unlink(missing_ok=True)
    with _beside(path, "new").open("xb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _keep_old(path: Path) -> Callable[[], None]:
    """Keep a file under a second name; return a function that restores the present state."""
    old = _beside(path, "old")
    old.unlink(missing_ok=True)
    if not os.path.lexists(path):
        return partial(path.unlink, missing_ok=True)
    try:
        os.link(path, old, follow_symlinks=False)
    except OSError as error:
        if error.errno not in NO_LINKS:
            raise
        shutil.copy2(path, old, follow_symlinks=False)

    def restore() -> None:
        os.replace(old, path)
        old.unlink(missing_ok=True)  # where the path was still this file, replacing does nothing

    return restore


def _beside(path: Path, kind: Literal["new", "old"]) -> Path:
    """Return a name next to a file that only this process uses; `.dvcignore` has its pattern."""
    return path.with_name(f".{path.name}.{os.getpid()}.{kind}.tmp")


def _remove_litter(path: Path) -> None:
    """Remove what processes that were killed while they wrote a file left next to it."""
    for litter in path.parent.glob(f".{glob.escape(path.name)}.*.tmp"):
        match = re.search(r"\.(\d+)\.(new|old)\.tmp$", litter.name)
        if match and not _is_running(int(match[1])):
            litter.unlink(missing_ok=True)


def _is_running(process_id: int) -> bool:
    try:
        os.kill(process_id, 0)  # sends nothing
    except ProcessLookupError:
        return False
    except PermissionError:
        pass  # it is another user's
    return True


def _sync_folder(folder: Path) -> None:
    """Flush a folder's entries to disk, so that a new file survives a power cut."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file (see `write_all`)."""
    write_all({path: content})


def write_text(path: Path, content: str) -> None:
    """Write a UTF-8 text file (see `write_all`)."""
    write_all({path: content})


def write_json(path: Path, content: Any) -> None:
    """Write JSON (see `write_all` and `to_json`)."""
    write_all({path: to_json(content)})


def to_json(content: Any) -> str:
    """Return indented JSON that ends in a newline; NaN or infinity raises a ValueError."""
    return json.dumps(content, indent=2, allow_nan=False) + "\n"


def digest(path: Path) -> str:
    """Return the SHA-256 of a file's content in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def read_bytes(path: Path, stage: str) -> bytes:
    """Read a file that a stage has written; an InputError says what to run if that fails."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; run `dvc repro {stage}`") from error


def read_json(path: Path, stage: str) -> dict[str, Any]:
    """Read a JSON object that a stage has written; an InputError says what to run if that fails."""
    try:
        content = json.loads(read_bytes(path, stage))
        if not isinstance(content, dict):
            raise ValueError(f"given a {type(content).__name__}, allowed: an object")
    except ValueError as error:
        raise InputError(f"{path}: not JSON: {error}; run `dvc repro --force {stage}`") from error
    return content
