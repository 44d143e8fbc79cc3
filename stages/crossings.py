"""Summarize what the agents withstand, and where a rhythm that sees nothing overtakes them.

Usage:  python -m stages.crossings
Reads:  params.yaml, models/<agent>/seed-<n>/curve.csv, results/agents/<agent>/ (episodes.csv,
        variants.csv), results/robustness/<agent>.csv
Writes: results/robustness.json
"""

from jumping_ant.base.files import PROJECT_ROOT, write_json
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import results
from jumping_ant.robustness import summary

from . import parse, run


def main() -> None:
    """Run the stage."""
    settings = parse(__doc__)
    agents = results.load(PROJECT_ROOT, settings)
    write_json(Paths().robustness, summary.summarize(PROJECT_ROOT, settings, agents))


if __name__ == "__main__":
    run(main)
