"""Write the comparison as one page.

Usage: python -m stages.report
Reads: params.yaml; assets/, models/, media/, results/agents/, results/comparison.json; no seconds.
Writes: results/report.html.
"""

from jumping_ant.base.files import PROJECT_ROOT, blamed, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.report import page

from . import parse, run


def main() -> None:
    """Run the stage."""
    settings, paths = parse(__doc__), Paths()
    with blamed("compare", paths.comparison, paths.robustness):
        write_text(paths.report, page.build(PROJECT_ROOT, settings))


if __name__ == "__main__":
    run(main)
