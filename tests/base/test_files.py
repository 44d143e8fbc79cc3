"""Files are whole or absent, whatever happens while they are written."""

import itertools
import os
import stat
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from jumping_ant.base import files
from jumping_ant.base.errors import InputError


def test_folders_are_made_and_the_content_is_as_given(tmp_path: Path) -> None:
    path = tmp_path / "new" / "folder" / "policy.zip"
    for content in (b"\x00\xff\r\n", "na\xefve\n"):
        files.write_all({path: content})
        assert path.read_bytes() == (content if isinstance(content, bytes) else content.encode())


@pytest.mark.parametrize(("umask", "mode"), [(0o022, 0o644), (0o077, 0o600)])
def test_permissions_are_those_that_open_gives(tmp_path: Path, umask: int, mode: int) -> None:
    before = os.umask(umask)
    try:
        files.write_text(tmp_path / "a", "new")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == mode


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


@pytest.mark.parametrize("number", range(len(NEW)))
def test_if_one_file_cannot_be_written_all_stay_as_they_were(
    tmp_path: Path, number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path, OLD)
    calls, flush = itertools.count(), os.fsync

    def failing(descriptor: int) -> None:
        if next(calls) == number:
            raise OSError(28, "No space left on device")
        flush(descriptor)

    monkeypatch.setattr(os, "fsync", failing)
    with pytest.raises(OSError, match="No space left"):
        write(tmp_path, NEW)
    assert contents(tmp_path) == OLD
    write(tmp_path, NEW)
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


def test_contents_reach_the_disk_before_their_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So a power cut leaves the old files or the new, but none that is empty."""
    order = []
    for name in ("fsync", "replace"):
        called = getattr(os, name)

        def noting(*arguments: Any, called: Any = called, name: str = name) -> None:
            is_folder = name == "fsync" and stat.S_ISDIR(os.fstat(arguments[0]).st_mode)
            order.append("folder" if is_folder else name)
            called(*arguments)

        monkeypatch.setattr(os, name, noting)
    write(tmp_path, {"a": "new a", "b": "new b"})
    assert order == ["fsync", "fsync", "replace", "replace", "folder"]


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
def test_json_has_no_numbers_that_are_none(tmp_path: Path, number: float) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        files.write_json(tmp_path / "a.json", {"x": number})
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_regular_file_is_not_read(tmp_path: Path) -> None:
    """A link to a device has no end, and a pipe may have no writer."""
    pipe, link = tmp_path / "pipe", tmp_path / "link"
    os.mkfifo(pipe)
    link.symlink_to("/dev/zero")
    for path in (pipe, link, tmp_path):
        with pytest.raises(
            InputError, match="(Not a regular file|Is a directory); run `dvc repro x"
        ):
            files.read_bytes(path, "x")
