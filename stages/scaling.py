"""Time how a population's evaluation speeds up with threads.

Usage: python -m stages.scaling
Reads: params `seeds`, `env`, `agents`; assets/jumping_ant.xml.
Writes: results/scaling.csv.
"""

import argparse

from jumping_ant import params, robot, scaling
from jumping_ant.files import PROJECT_ROOT, write_text
from stages import run


def main() -> None:
    """Run the stage."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    settings = params.load()
    rows = scaling.measure(robot.read(PROJECT_ROOT), settings)
    lines = [",".join(scaling.COLUMNS)]
    lines += [",".join(str(row[column]) for column in scaling.COLUMNS) for row in rows]
    write_text(PROJECT_ROOT / "results" / "scaling.csv", "\n".join(lines) + "\n")


if __name__ == "__main__":
    run(main)
