"""The code that a training run depends on."""

from pathlib import Path

from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.base import imports

PACKAGE = "jumping_ant.agents"
PACKAGES = Path(__file__).parent


def trainers() -> list[str]:
    """Return the names of the packages that train agents."""
    return sorted(path.parent.name for path in PACKAGES.glob("*/trainer.py"))


def code_of(trainer: str, script: Path) -> set[Path]:
    """Return the files that a training run depends on.

    The catalogue imports the settings of every algorithm and names what its trainer builds; of the
    trainers' packages, only the agent's own counts.

    Args:
        trainer: The package that trains the agent.
        script: The file that calls the trainer.
    """
    package = f"{PACKAGE}.{trainer}"
    learners = {row.learner.partition(":")[0] for row in ALGORITHMS.values()}
    modules = [f"{package}.trainer", *(name for name in learners if name.startswith(f"{package}."))]
    own = [file for name in modules for file in imports.files_of(name)]
    others = [PACKAGES / name for name in trainers() if name != trainer]
    files = imports.closure(script, *own)
    return {file for file in files if not any(other in file.parents for other in others)}
