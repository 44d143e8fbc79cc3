"""Bring MLflow up to date with the files; entries that it already has are left unchanged.

Usage: python -m stages.track
Reads: params.yaml; assets/robot.json, models/, media/, results/.
Writes: no file; runs, models and artifacts go to `MLFLOW_TRACKING_URI`, by default to mlflow.db and
mlartifacts/ in the project folder.
"""

from jumping_ant.base import command_line
from jumping_ant.tracking.mirror import track

from . import run


def main() -> None:
    """Run the stage."""
    command_line.parser(__doc__).parse_args()
    track()


if __name__ == "__main__":
    run(main)
