"""Time short pieces of training, and summarize what training takes on this machine.

Usage:  python -m stages.timing
Reads:  params.yaml, claims/, the robots in assets/, models/<agent>/seed-<n>/curve.csv,
        results/agents/<agent>/ (episodes.csv, variants.csv), results/timing/<agent>/timing.csv,
        results/comparison.json
Writes: results/scaling.csv, results/speed.json
"""

from jumping_ant.base.files import PROJECT_ROOT, blamed, read_json, to_json, write_all
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import results, timing
from jumping_ant.params import claims
from jumping_ant.training import curves, scaling

from . import parse, run


def main() -> None:
    """Run the stage."""
    settings, paths = parse(__doc__), Paths()
    asked = claims.of_project(PROJECT_ROOT, settings)
    agents = results.load(PROJECT_ROOT, settings, curves.read_timed)
    compared = read_json(paths.comparison, "compare")
    measured = scaling.measure_all(PROJECT_ROOT, settings)
    with blamed("compare", paths.comparison):
        timed = timing.summarize(settings, asked, agents, compared, measured)
    write_all({paths.scaling: scaling.to_csv(measured), paths.speed: to_json(timed)})


if __name__ == "__main__":
    run(main)
