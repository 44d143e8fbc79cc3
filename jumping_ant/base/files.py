"""Atomic writes, reads of stage outputs, and digests of files."""

import errno
import glob
import hashlib
import json
import os
import re
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from jumping_ant.base.errors import InputError, told

CODE_ROOT = Path(__file__).resolve().parents[2]  # the folder that contains the library
# The project that commands work on: the checkout or, if the library is installed from a wheel, the
# current folder.
PROJECT_ROOT = CODE_ROOT if (CODE_ROOT / "pyproject.toml").is_file() else Path.cwd()


def write_all(contents: Mapping[Path, bytes | str]) -> None:
    """Write whole files; if one cannot be written, as on a full disk, all stay as they were.

    Every file is written next to its path before the first one is put in place, so a reader sees
    the old content or the new. If putting one in place fails, those before it stay new: run the
    stage again. Text is UTF-8; missing folders are created. A symbolic link is replaced, not
    followed: DVC may have linked the path to its cache.
    """
    for path in contents:
        path.parent.mkdir(parents=True, exist_ok=True)
        _remove_litter(path)
    try:
        for path, content in contents.items():
            with _beside(path).open("wb") as file:
                file.write(content.encode() if isinstance(content, str) else content)
                file.flush()
                os.fsync(file.fileno())
        for path in contents:
            os.replace(_beside(path), path)
    finally:
        for path in contents:
            _beside(path).unlink(missing_ok=True)
    for folder in {path.parent for path in contents}:
        _sync_folder(folder)


def _beside(path: Path) -> Path:
    """Return a name next to a file that only this process uses; `.dvcignore` has its pattern."""
    return path.with_name(f".{path.name}.{os.getpid()}.tmp")


def _remove_litter(path: Path) -> None:
    """Remove what processes that were killed while they wrote a file left next to it."""
    import psutil  # type: ignore[import-untyped]  # 14 ms that seeds' processes do without

    for litter in path.parent.glob(f".{glob.escape(path.name)}.*.tmp"):
        match = re.search(r"\.(\d+)\.tmp$", litter.name)
        if match and not psutil.pid_exists(int(match[1])):
            litter.unlink(missing_ok=True)


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


@contextmanager
def regular(path: Path) -> Iterator[BinaryIO]:
    """Open a regular file; others, which may have no end or no writer, are an OSError."""
    with open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise OSError(errno.EINVAL, "Not a regular file")
        yield file


def content(path: Path) -> bytes:
    """Return the content of a regular file."""
    with regular(path) as file:
        return file.read()


def read_bytes(path: Path, stage: str) -> bytes:
    """Read a file that a stage has written; an InputError says what to run if that fails."""
    try:
        return content(path)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; run `dvc repro {stage}`") from error


def read_json(path: Path, stage: str) -> dict[str, Any]:
    """Read a JSON object that a stage has written; an InputError says what to run if that fails."""
    try:
        found = json.loads(read_bytes(path, stage))
        if not isinstance(found, dict):
            raise ValueError(f"given a {type(found).__name__}, allowed: an object")
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not JSON: {error}; run `dvc repro --force {stage}`") from error
    return found


@contextmanager
def blamed(stage: str, *paths: Path) -> Iterator[None]:
    """Turn what values that a stage does not write raise into an InputError that names its files.

    A ValueError says what was given; what others say is put in brackets.
    """
    try:
        yield
    except InputError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError, OverflowError) as error:
        fault = f"given other values than {stage} writes ({told(error)})"
        if isinstance(error, ValueError):
            fault = " ".join(str(error).split())
        names = " or ".join(map(str, paths))
        raise InputError(f"{names}: {fault}; run `dvc repro --force {stage}`") from error
