"""Record a trained agent's episodes for an algorithm whose agents learn from them.

Usage: python -m stages.demonstrate ALGORITHM (DVC names it in the environment)
Reads: params `seeds`, `env`, `demonstrations.ALGORITHM`; the robot in assets/;
    the demonstrating agent's models/AGENT/seed-N/ (policy.zip, validation.csv) and
    results/agents/AGENT/training.json;
    .inputs/code/train-ALGORITHM.json.
Writes: .inputs/train/ALGORITHM/ (demonstrations.zip, code.json).
"""

from jumping_ant.base import machine
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT, read_bytes, write_all
from jumping_ant.base.paths import Paths
from jumping_ant.training import demonstrating

from . import parse_key, run


def main() -> None:
    """Run the stage."""
    algorithm, settings = parse_key(__doc__, "algorithm")
    if algorithm not in settings.demonstrations:
        known = ", ".join(settings.demonstrations) or "there is none"
        raise InputError(
            f"algorithm: given {algorithm!r}, allowed: those of demonstrations ({known})"
        )
    paths = Paths()
    made = demonstrating.demonstrate(PROJECT_ROOT, settings, algorithm, machine.num_cores())
    write_all(
        {
            paths.demonstrations(algorithm): made.to_bytes(),
            paths.training_code(algorithm): read_bytes(paths.code(f"train-{algorithm}"), "digest"),
        }
    )


if __name__ == "__main__":
    run(main)
