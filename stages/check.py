"""Check all parameters, before any other stage runs.

Usage: python -m stages.check
Reads: params.yaml.
Writes: .inputs/checked, which always holds the same, so that no stage reruns because of it.
"""

from jumping_ant.base.files import write_text
from jumping_ant.base.paths import Paths

from . import parse, run


def main() -> None:
    """Run the stage."""
    parse(__doc__)
    write_text(Paths().checked, "params.yaml is valid.\n")


if __name__ == "__main__":
    run(main)
