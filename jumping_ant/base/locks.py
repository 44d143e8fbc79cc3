"""Locks of files, which no other user may take, unless a group shares the project."""

import configparser
import os
import subprocess
from pathlib import Path
from typing import Any

from filelock import FileLock

ALONE, SHARED = 0o600, 0o660  # who may open, and so take, a lock
GROUP = ("group", "true", "1", "yes", "on", "all", "world", "everybody", "2")  # as git says it


def lock(path: Path, root: Path, **options: Any) -> FileLock:
    """Return a lock in a project, with other options of `FileLock`; its folder exists by then."""
    path.parent.mkdir(parents=True, exist_ok=True)
    mode = SHARED if _is_shared(root) else ALONE
    if path.exists() and not path.is_symlink() and path.stat().st_uid == os.getuid():
        path.chmod(mode)
    return FileLock(path, mode=mode, **options)


def _is_shared(root: Path) -> bool:
    """Tell whether git's or DVC's settings let a group write to a project."""
    settings = configparser.ConfigParser(strict=False, interpolation=None)
    settings.read([root / ".dvc" / "config", root / ".dvc" / "config.local"], encoding="utf-8")
    asked = ["git", "-C", str(root), "config", "core.sharedRepository"]
    try:
        told = subprocess.run(asked, capture_output=True, encoding="utf-8").stdout.strip().lower()
    except OSError:
        told = ""
    is_octal = told.startswith("0") and told[-2:-1] in ("6", "7")  # such as 0660
    return settings.get("cache", "shared", fallback="") == "group" or told in GROUP or is_octal
