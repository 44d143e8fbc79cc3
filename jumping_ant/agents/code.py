"""The code that a training run depends on."""

from pathlib import Path

from jumping_ant.base import imports

PACKAGES = Path(__file__).parent


def trainers() -> list[str]:
    """Return the names of the packages that train agents."""
    return sorted(path.parent.name for path in PACKAGES.glob("*/trainer.py"))


def code_of(trainer: str, script: Path) -> set[Path]:
    """Return the files that a training run depends on.

    The catalogue imports the settings of every algorithm; of the trainers' packages, only the
    agent's own counts.

    Args:
        trainer: The package that trains the agent.
        script: The file that calls the trainer.
    """
    others = [PACKAGES / name for name in trainers() if name != trainer]
    files = imports.closure(script, *(PACKAGES / trainer).rglob("*.py"))
    return {file for file in files if not any(other in file.parents for other in others)}
