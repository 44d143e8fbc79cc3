"""Files are whole or absent, whatever happens while they are written."""

import hashlib
import os
import stat
from pathlib import Path

import pytest

from jumping_ant.base import files


def test_folders_are_made_and_the_content_is_as_given(tmp_path: Path) -> None:
    path = tmp_path / "new" / "folder" / "policy.zip"
    files.write_bytes(path, b"\x00\xff\r\n")
    assert path.read_bytes() == b"\x00\xff\r\n"
    assert stat.S_IMODE(path.stat().st_mode) == 0o644
    files.write_text(path, "naïve\n")
    assert path.read_bytes() == b"na\xc3\xafve\n"


def test_a_failed_write_leaves_the_old_file_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "metrics.json"
    files.write_text(path, "old")

    def full_disk(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OSError, match="No space left"):
        files.write_text(path, "new")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_json_keeps_the_order_of_keys_and_all_digits(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    files.write_json(path, {"b": 0.1, "a": [1, None]})
    assert path.read_text() == '{\n  "b": 0.1,\n  "a": [\n    1,\n    null\n  ]\n}\n'


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
def test_json_has_no_numbers_that_are_none(tmp_path: Path, number: float) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        files.write_json(tmp_path / "a.json", {"x": number})
    assert list(tmp_path.iterdir()) == []


def test_digest_is_that_of_the_content(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"abc")
    assert files.digest(path) == hashlib.sha256(b"abc").hexdigest()


def test_the_project_root_holds_the_parameters() -> None:
    assert (files.PROJECT_ROOT / "params.yaml").is_file()
