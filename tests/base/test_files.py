"""Files are whole or absent, whatever happens while they are written."""

import itertools
import os
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from jumping_ant.base import files


def test_folders_are_made_and_the_content_is_as_given(tmp_path: Path) -> None:
    path = tmp_path / "new" / "folder" / "policy.zip"
    for content in (b"\x00\xff\r\n", "na\xefve\n"):
        files.write_all({path: content})
        assert path.read_bytes() == (content if isinstance(content, bytes) else content.encode())


def test_a_new_file_has_the_permissions_that_its_user_gives(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        files.write_text(tmp_path / "a", "")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == 0o640


def test_a_link_is_replaced_and_not_followed(tmp_path: Path) -> None:
    """DVC may have linked an output to its cache."""
    cached, path = tmp_path / "cached", tmp_path / "a"
    cached.write_text("in the cache", encoding="utf-8")
    path.symlink_to(cached)
    files.write_text(path, "new")
    assert path.read_text(encoding="utf-8") == "new" and not path.is_symlink()
    assert cached.read_text(encoding="utf-8") == "in the cache"


OLD = {"a": "old a", "folder/c": "old c"}
NEW = {"a": "new a", "b": "new b", "folder/c": "new c"}


def contents(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): path.read_text(encoding="utf-8")
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def write(folder: Path, texts: dict[str, str]) -> None:
    files.write_all({folder / name: text for name, text in texts.items()})


@pytest.mark.parametrize("operation", ["fsync", "replace", "open"])
def test_a_failure_leaves_no_mixture(
    tmp_path: Path, operation: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whichever call fails, the first or the last; a failed write leaves all files as they were."""
    called = getattr(os, operation)
    for number in itertools.count():
        write(tmp_path, OLD)
        left = number

        def failing(*args: object, **keywords: object) -> object:
            nonlocal left
            left -= 1
            if left == -1:
                raise OSError(28, "No space left on device")
            return called(*args, **keywords)

        with monkeypatch.context() as patch:
            patch.setattr(os, operation, failing)
            try:
                write(tmp_path, NEW)
                break
            except OSError as error:
                assert "No space left" in str(error)
        for name, content in contents(tmp_path).items():
            assert content in (OLD.get(name), NEW[name])
        if number < len(NEW) and operation == "fsync":
            assert contents(tmp_path) == OLD
        (tmp_path / "b").unlink(missing_ok=True)
    assert number >= 2
    assert contents(tmp_path) == NEW


KILLED = """
import os, sys
from pathlib import Path
from jumping_ant.base import files

left = int(sys.argv[2])

def count_and_die(event, _):
    global left
    if event in ("open", "os.rename", "os.remove"):
        left -= 1
        if left < 0:
            os.kill(os.getpid(), 9)

sys.addaudithook(count_and_die)
files.write_all({Path(sys.argv[1]) / name: "new " + name for name in "ab"})
"""


def test_what_a_killed_write_leaves_is_removed_by_the_next(tmp_path: Path) -> None:
    write(tmp_path, {"a": "old a"})
    for number in itertools.count():
        killed = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path), str(number)])
        if killed.returncode == 0:
            break
        left = contents(tmp_path)
        assert left["a"] in ("old a", "new a") and left.get("b") in (None, "new b")
        write(tmp_path, {"a": "old a"})
        assert not [name for name in contents(tmp_path) if name.startswith(".a.")]
        (tmp_path / "b").unlink(missing_ok=True)
    assert number > 5
    assert contents(tmp_path) == {"a": "new a", "b": "new b"}


class Disk:
    """A disk that forgets: what survives a power cut is what was flushed to it.

    A file's content survives once it was flushed. Changes to a folder's entries survive in their
    order, all of them once the folder was flushed, and some of them before.
    """

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder = folder
        self.contents: dict[int, bytes] = {}  # flushed, by inode
        self.entries = [self.listing()]  # after each change
        self.certain = 0  # entries that surely survive: those of the last flush
        for name in ("replace", "link", "unlink"):
            monkeypatch.setattr(os, name, self.noting(getattr(os, name)))
        flush = os.fsync

        def fsync(descriptor: int) -> None:
            flush(descriptor)
            status = os.fstat(descriptor)
            if stat.S_ISDIR(status.st_mode):
                self.certain = len(self.entries) - 1
            else:
                os.lseek(descriptor, 0, os.SEEK_SET)
                path = next(
                    path for path in folder.iterdir() if path.stat().st_ino == status.st_ino
                )
                self.contents[status.st_ino] = path.read_bytes()

        monkeypatch.setattr(os, "fsync", fsync)

    def listing(self) -> dict[str, int]:
        return {path.name: path.stat().st_ino for path in self.folder.iterdir()}

    def noting(self, change: Callable[..., None]) -> Callable[..., None]:
        def noted(*arguments: Any, **keywords: Any) -> None:
            change(*arguments, **keywords)
            self.entries.append(self.listing())

        return noted

    def after_a_cut(self) -> list[dict[str, bytes]]:
        """Return what may be there afterwards; what was never flushed is empty."""
        return [
            {name: self.contents.get(inode, b"") for name, inode in entries.items()}
            for entries in self.entries[self.certain :]
        ]


def test_a_power_cut_leaves_the_old_files_or_the_new(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path, {"a": "old a", "c": "old c"})
    disk = Disk(tmp_path, monkeypatch)
    disk.contents = {path.stat().st_ino: path.read_bytes() for path in tmp_path.iterdir()}
    seen = []
    for name in ("replace", "link", "unlink", "fsync"):  # look after each of them
        called = getattr(os, name)

        def looking(*arguments: Any, called: Any = called, **keywords: Any) -> None:
            called(*arguments, **keywords)
            seen.extend(disk.after_a_cut())

        monkeypatch.setattr(os, name, looking)
    write(tmp_path, {"a": "new a", "b": "new b", "c": "new c"})
    assert len(seen) > 10
    for found in seen:
        assert found["a"] in (b"old a", b"new a") and found["c"] in (b"old c", b"new c")
        assert found.get("b") in (None, b"new b")
    assert {found["a"] for found in seen} == {b"old a", b"new a"}
    (last,) = disk.after_a_cut()[-1:]
    assert (last["a"], last["b"], last["c"]) == (b"new a", b"new b", b"new c")


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
def test_json_has_no_numbers_that_are_none(tmp_path: Path, number: float) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        files.write_json(tmp_path / "a.json", {"x": number})
    assert list(tmp_path.iterdir()) == []
