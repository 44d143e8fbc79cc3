"""Files as they are committed (or staged): a run of the user rewrites results in his folder."""

import subprocess
from pathlib import Path

from jumping_ant.base.files import PROJECT_ROOT


def text(name: str) -> str:
    """Return the content of a file."""
    return _git("show", f":{name}")


def extract(folder: Path, *names: str) -> None:
    """Write files, and all files of folders, below another folder."""
    listed = _git("ls-files", "-z", "--", *names)
    _git("checkout-index", "-z", "--stdin", f"--prefix={folder}/", given=listed)


def _git(*arguments: str, given: str = "") -> str:
    command = ["git", *arguments]
    return subprocess.run(
        command, cwd=PROJECT_ROOT, input=given, stdout=subprocess.PIPE, encoding="utf-8", check=True
    ).stdout
