"""Judge claims on anybody's runs, or this project's agents beside those of another run.

Usage:
    python -m jumping_ant.comparison RUNS CLAIMS [--metric NAME] [--learned RETURN] [--page FILE]
    python -m jumping_ant.comparison --against REVISION

RUNS is a table (agent, seed, step, return, and seconds if known), a folder of TensorBoard's, or
mlflow:EXPERIMENT; CLAIMS a list as in `claims/`. Prints verdicts, and writes a page with curves,
intervals and pairs. With --against prints whether the agents return more than those of a commit, a
tag or an experiment of DVC.
"""

from pathlib import Path

from jumping_ant.base import command_line, output
from jumping_ant.base.errors import reported
from jumping_ant.base.files import PROJECT_ROOT, write_text
from jumping_ant.comparison import against, claims, comparison, runs
from jumping_ant.params import claims as asked
from jumping_ant.params import params_file

MLFLOW = "mlflow:"


def main() -> None:
    """Parse the command line and judge."""
    parser = command_line.parser(__doc__)
    parser.add_argument("runs", nargs="?", help="table.csv, a folder of TensorBoard's, mlflow:NAME")
    parser.add_argument("claims", nargs="?", type=Path, help="a list of claims, as in claims/")
    parser.add_argument("--metric", default="", help="the return in TensorBoard's files or MLflow")
    parser.add_argument("--learned", type=float, help="a return that says something was learned")
    parser.add_argument("--page", type=Path, default=Path("comparison.html"), help="to write")
    parser.add_argument("--against", metavar="REVISION", help="a commit, tag or DVC experiment")
    options = parser.parse_args()
    if options.against:
        judged = against.judge(PROJECT_ROOT, params_file.load(), options.against)
        for name, (word, evidence) in judged.items():
            print(f"{name}: {word}\n  {evidence}" if evidence else f"{name}: {word}")
        return
    if not (options.runs and options.claims):
        parser.error("RUNS and CLAIMS, or --against REVISION, are needed")
    params = params_file.check(params_file.read(params_file.DEFAULTS)).compare
    agents = runs.results(rows(options.runs, options.metric))
    verdicts = claims.judge(asked.read(options.claims), agents, params, options.learned)
    for entry in verdicts["claims"]:
        print(f"{entry['verdict']}: {entry['text']}\n  {entry['evidence']}")
    for entry in verdicts["not_asked"]:
        print(f"not asked: {entry['text']} ({entry['reason']})")
    from jumping_ant.report import runs_page  # imports Plotly

    summary = comparison.summarize(agents, params) | verdicts
    write_text(options.page, runs_page.build(agents, params, summary))
    print(f"see {options.page}")


def rows(source: str, metric: str) -> list[runs.Row]:
    """Return the rows of a source."""
    if source.startswith(MLFLOW):
        from jumping_ant.tracking import experiments  # imports MLflow

        return experiments.rows(PROJECT_ROOT, source.removeprefix(MLFLOW), metric)
    path = Path(source)
    return runs.from_tensorboard(path, metric) if path.is_dir() else runs.from_csv(path)


if __name__ == "__main__":
    output.tolerate_failures()
    command_line.switch_off_telemetry()
    with reported():
        main()
