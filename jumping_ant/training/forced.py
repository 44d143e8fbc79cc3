"""Whether the user asks for a training that is done already, with `dvc repro --force`."""

from contextlib import suppress
from pathlib import Path

import psutil  # type: ignore[import-untyped]


def is_forced() -> bool:
    """Tell whether DVC was told to run everything; only DVC's command line says so."""
    for process in psutil.Process().parents():
        words: list[str] = []
        with suppress(psutil.Error):
            words = process.cmdline()
        names = [Path(word).name for word in words[:3]]  # DVC alone, or after an interpreter
        options = words[names.index("dvc") + 1 :] if "dvc" in names else []
        if {"repro", "exp"} & set(options):
            from dvc.cli import parse_args  # type: ignore[import-untyped]

            return bool(getattr(parse_args(options), "force", False))
    return False
