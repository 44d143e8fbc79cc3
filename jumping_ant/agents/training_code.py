"""The code that a training run depends on."""

from pathlib import Path

from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.base import imports

PACKAGES = Path(__file__).parent


def packages() -> list[str]:
    """Return the names of the families' packages."""
    return sorted(path.parent.name for path in PACKAGES.glob("*/algorithms.py"))


def training_code(algorithm: str, script: Path) -> set[Path]:
    """Return the files that a training run depends on, if `script` calls the trainer.

    The catalogue imports the settings of every algorithm; of the families, only the algorithm's
    counts.
    """
    row = ALGORITHMS[algorithm]
    called = imports.files_of(row.trainer) | imports.files_of(row.learner.partition(":")[0])
    others = {PACKAGES / name for name in packages() if name != row.package}
    files = imports.closure(script, *called)
    return {file for file in files if others.isdisjoint(file.parents)}
