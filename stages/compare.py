"""Compare the agents: statistics over seeds, verdicts on the claims, figures.

Usage:  python -m stages.compare
Reads:  params.yaml, models/<agent>/seed-<n>/curve.csv, results/agents/<agent>/ (episodes.csv,
        timing.csv, scaling.csv, variants.csv)
Writes: results/comparison.json, results/figures/, results/plots/
"""

from jumping_ant.base.files import PROJECT_ROOT, write_json, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.judging import comparison, results
from jumping_ant.judging.claims import verdicts
from jumping_ant.showing import figures

from . import parse, run


def main() -> None:
    """Run the stage."""
    settings = parse(__doc__)
    agents = results.load(PROJECT_ROOT, settings)
    summary = comparison.summarize(agents, settings.compare)
    curves = comparison.learning_curves(agents, settings.compare)
    claims = verdicts.check(agents, settings.compare, settings.training.evaluation_episodes)

    paths = Paths()
    write_json(paths.comparison, summary | {"claims": claims})
    curve_table = comparison.to_csv(comparison.curve_rows(curves))
    write_text(paths.plots / "learning_curves.csv", curve_table)
    write_text(paths.plots / "seeds.csv", comparison.to_csv(comparison.seed_rows(agents)))
    drawn = figures.draw(agents, curves, summary, claims, settings.compare.confidence)
    figures.write(paths.figures, drawn)


if __name__ == "__main__":
    run(main)
