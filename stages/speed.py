"""Summarize what training took, on this machine: seconds, and the claims that rest on them.

Usage:  python -m stages.speed
Reads:  params.yaml, models/<agent>/seed-<n>/curve.csv, results/agents/<agent>/ (episodes.csv,
        variants.csv), results/timing/<agent>/ (timing.csv, scaling.csv, machines.json),
        results/comparison.json
Writes: results/speed.json, results/speed/, results/speed.html
"""

from jumping_ant.base import tables
from jumping_ant.base.files import PROJECT_ROOT, read_json, to_json, write_all
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import charting, comparison, results
from jumping_ant.comparison.figures import figures
from jumping_ant.experiment import curves, summaries
from jumping_ant.speed import page, seconds

from . import parse, run


def main() -> None:
    """Run the stage."""
    settings, paths = parse(__doc__), Paths()
    agents = results.load(PROJECT_ROOT, settings, curves.read_timed)
    compared = read_json(paths.comparison, "compare")
    timed = seconds.summarize(PROJECT_ROOT, settings, agents, compared)
    learned = comparison.learning_curves(agents, settings.compare, "seconds")

    summary = summaries.merged(compared, timed) | {"claims": timed["claims"]}
    confidence = settings.compare.confidence
    drawn = figures.draw_costs(agents, learned, summary, timed["claims"], confidence, "seconds")

    rows = comparison.curve_rows(learned, charting.families(agents), "seconds")
    write_all(
        {
            paths.speed: to_json(timed),
            paths.speed_files / "learning_curves.csv": tables.to_csv(rows),
            paths.speed_page: page.build(PROJECT_ROOT, settings, agents, summary),
            **{paths.speed_files / name: content for name, content in figures.files(drawn).items()},
        }
    )


if __name__ == "__main__":
    run(main)
