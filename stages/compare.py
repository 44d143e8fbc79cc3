"""Compare the agents: statistics over seeds, what they withstand, claims, figures.

Usage:  python -m stages.compare
Reads:  params.yaml, claims/, models/<agent>/seed-<n>/curve.csv, results/agents/<agent>/
        (episodes.csv, variants.csv), results/robustness/<agent>.csv
Writes: results/comparison.json, results/robustness.json, results/curves.csv, results/figures/,
        results/plots/
"""

from jumping_ant.base import tables
from jumping_ant.base.files import PROJECT_ROOT, to_json, write_all
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import claims, comparison, results, retention
from jumping_ant.params import claims as asked
from jumping_ant.report import figures
from jumping_ant.report.outcome import Outcome

from . import parse, run


def main() -> None:
    """Run the stage."""
    settings = parse(__doc__)
    played = retention.read(PROJECT_ROOT, settings)
    agents = retention.with_groups(results.load(PROJECT_ROOT, settings), played)
    learned = claims.out_of_luck(agents.values(), settings.training.evaluation_episodes)
    outcome = Outcome(settings, agents, comparison.summarize(agents, settings.compare, learned))
    family = claims.on_seconds(asked.of_project(PROJECT_ROOT, settings), is_so=False)
    judged = claims.judge(family, agents, settings.compare, learned)

    files = figures.draw(outcome)

    paths = Paths()
    curve_table = tables.to_csv(comparison.curve_rows(outcome.curves, outcome.families))
    write_all(
        {
            paths.comparison: to_json({**outcome.summary, **judged}),
            paths.robustness: to_json(retention.summarize(played, settings.compare.confidence)),
            paths.curves: tables.to_csv(comparison.evaluation_rows(agents)),
            paths.plots / "learning_curves.csv": curve_table,
            **{paths.figures / name: content for name, content in files.items()},
        }
    )


if __name__ == "__main__":
    run(main)
