"""Atomic writes, reads of stage outputs, and digests of files."""

import hashlib
import json
import os
import tempfile
from pathlib import Path
from typing import Any

from jumping_ant.base.errors import InputError

CODE_ROOT = Path(__file__).resolve().parents[2]  # the folder that contains the library
# The project that commands work on: the checkout or, if the library is installed from a wheel, the
# current folder.
PROJECT_ROOT = CODE_ROOT if (CODE_ROOT / "pyproject.toml").is_file() else Path.cwd()


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file atomically: a reader sees the old content or the new, never a mix.

    Args:
        path: Path of the file; missing parent folders are created.
        content: The whole content.

    Raises:
        OSError: The folder cannot be written to, or the disk is full; `path` is then untouched.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(name, 0o644)  # mkstemp makes files that only their owner may read
        os.replace(name, path)
        _sync_folder(path.parent)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _sync_folder(folder: Path) -> None:
    """Flush a folder's entries to disk, so that a new file survives a power cut."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_text(path: Path, content: str) -> None:
    """Write a UTF-8 text file atomically (see `write_bytes`)."""
    write_bytes(path, content.encode())


def write_json(path: Path, content: Any) -> None:
    """Write JSON atomically, indented, keys in the order given, ending in a newline.

    Raises:
        ValueError: The content holds a number that JSON cannot express (NaN or infinity).
    """
    write_text(path, json.dumps(content, indent=2, allow_nan=False) + "\n")


def digest(path: Path) -> str:
    """Return the SHA-256 of a file's content in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def read_bytes(path: Path, stage: str) -> bytes:
    """Read a file that a stage has written.

    Raises:
        InputError: The file cannot be read; the message says what to run.
    """
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; run `dvc repro {stage}`") from error


def read_json(path: Path, stage: str) -> dict[str, Any]:
    """Read a JSON object that a stage has written.

    Raises:
        InputError: The file cannot be read or is not a JSON object; the message says what to run.
    """
    try:
        content = json.loads(read_bytes(path, stage))
        if not isinstance(content, dict):
            raise ValueError(f"given a {type(content).__name__}, allowed: an object")
    except ValueError as error:
        raise InputError(f"{path}: not JSON: {error}; run `dvc repro --force {stage}`") from error
    return content
