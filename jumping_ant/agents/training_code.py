"""The code that a training run depends on."""

from pathlib import Path

from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.base import imports

PACKAGES = Path(__file__).parent


def packages() -> list[str]:
    """Return the names of the packages that train agents."""
    return sorted(path.parent.name for path in PACKAGES.glob("*/trainer.py"))


def training_code(algorithm: str, script: Path) -> set[Path]:
    """Return the files that a training run depends on, if `script` calls the trainer.

    The catalogue imports the settings of every algorithm and names what its trainer builds; of the
    packages that train, only the algorithm's own counts.
    """
    row = ALGORITHMS[algorithm]
    own = imports.files_of(row.trainer) | imports.files_of(row.learner.partition(":")[0])
    others = {PACKAGES / name for name in packages()} - {file.parent for file in own}
    files = imports.closure(script, *own)
    return {file for file in files if others.isdisjoint(file.parents)}
