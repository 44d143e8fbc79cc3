"""Compare the agents: statistics over seeds, verdicts on the claims, figures.

Usage:  python -m stages.compare
Reads:  params.yaml, results/<agent>/episodes.csv, models/<agent>/seed-<n>/curve.csv,
        results/timing/<agent>.csv, results/scaling/<agent>.csv
Writes: results/comparison.json, results/figures/, results/plots/
"""

from jumping_ant import claims, comparison, figures, params_file
from jumping_ant.files import PROJECT_ROOT, write_json, write_text
from stages import run


def main() -> None:
    """Run the stage."""
    settings = params_file.load()
    results = comparison.load(PROJECT_ROOT, settings)
    summary = comparison.summarize(results, settings.compare)
    curves = comparison.learning_curves(results, settings.compare)
    verdicts = claims.check(results, settings.compare)

    output = PROJECT_ROOT / "results"
    write_json(output / "comparison.json", summary | {"claims": verdicts})
    curve_table = comparison.to_csv(comparison.curve_rows(curves))
    write_text(output / "plots" / "learning_curves.csv", curve_table)
    write_text(output / "plots" / "seeds.csv", comparison.to_csv(comparison.seed_rows(results)))
    drawn = figures.draw(results, curves, summary, settings.compare.confidence)
    figures.write(output / "figures", drawn)


if __name__ == "__main__":
    run(main)
