"""Locks that others of the machine cannot take."""

import subprocess
from pathlib import Path

import pytest

from jumping_ant.base import locks
from jumping_ant.base.files import write_text


@pytest.mark.parametrize(
    ("shared", "config", "mode"),
    [
        ("", "", 0o600),
        ("umask", "[cache]\n    type = copy\n", 0o600),
        ("group", "", 0o660),
        ("0660", "", 0o660),
        ("0640", "", 0o600),
        ("", "[cache]\n    shared = group\n", 0o660),
    ],
)
def test_a_lock_is_its_users_or_that_of_a_group_that_shares_the_project(
    tmp_path: Path, shared: str, config: str, mode: int
) -> None:
    """Whatever an earlier version of it was."""
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    if shared:
        command = ["git", "config", "core.sharedRepository", shared]
        subprocess.run(command, cwd=tmp_path, check=True)
    write_text(tmp_path / ".dvc" / "config", config)
    path = tmp_path / "folder" / "lock"
    for _ in range(2):
        with locks.lock(path, tmp_path):
            assert path.stat().st_mode & 0o777 == mode
        path.touch()
        path.chmod(0o644)
