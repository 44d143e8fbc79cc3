"""Write the comparison as one page.

Usage: python -m stages.report
Reads: params.yaml; assets/, models/, media/, results/.
Writes: results/report.html.
"""

import argparse

from jumping_ant.base.files import PROJECT_ROOT, write_text
from jumping_ant.params import params_file
from jumping_ant.showing.report import page
from stages import run


def main() -> None:
    """Run the stage."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    settings = params_file.load()
    write_text(PROJECT_ROOT / "results" / "report.html", page.build(PROJECT_ROOT, settings))


if __name__ == "__main__":
    run(main)
