"""Record a trained agent's episodes for a trainer whose agents learn from them.

Usage: python -m stages.demonstrate TRAINER (DVC names it in the environment)
Reads: params `seeds`, `env`, `training.publish`, `demonstrations.TRAINER`; the robot in assets/;
    the demonstrating agent's models/AGENT/seed-N/ (policy.zip, curve.csv);
    digests/train-TRAINER.json.
Writes: trainers/TRAINER/ (demonstrations.zip, code.json).
"""

from jumping_ant.base import machine
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT, read_bytes, write_all
from jumping_ant.base.paths import Paths
from jumping_ant.training import demonstrating

from . import parse_key, run


def main() -> None:
    """Run the stage."""
    trainer, settings = parse_key(__doc__, "trainer")
    if trainer not in settings.demonstrations:
        known = ", ".join(settings.demonstrations) or "there is none"
        raise InputError(f"trainer: given {trainer!r}, allowed: those of demonstrations ({known})")
    paths = Paths()
    made = demonstrating.demonstrate(PROJECT_ROOT, settings, trainer, machine.num_cores())
    write_all(
        {
            paths.demonstrations(trainer): made.to_bytes(),
            paths.code_of(trainer): read_bytes(paths.digests / f"train-{trainer}.json", "digest"),
        }
    )


if __name__ == "__main__":
    run(main)
