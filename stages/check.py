"""Check all parameters, before any other stage runs.

Usage: python -m stages.check
Reads: params.yaml, claims/, presets/.
Writes: .inputs/checked, which always holds the same, so that no stage reruns because of it.
"""

from jumping_ant.base.files import PROJECT_ROOT, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.params import claims

from . import parse, run


def main() -> None:
    """Run the stage."""
    claims.of_project(PROJECT_ROOT, parse(__doc__))
    write_text(Paths().checked, "params.yaml is valid.\n")


if __name__ == "__main__":
    run(main)
