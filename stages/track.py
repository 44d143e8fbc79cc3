"""Bring MLflow up to date with the files; run it again whenever you like, it repeats nothing.

Usage: python -m stages.track

Reads params.yaml, assets/jumping_ant.json, models/*/seed-*/{policy.zip,curve.csv}, results/ and
media/. Writes no file: runs, curves, models and artifacts go to `MLFLOW_TRACKING_URI`, by default
mlflow.db and mlartifacts/ in the project folder.
"""

import argparse

from jumping_ant.tracking.mirror import track
from stages import run


def main() -> None:
    """Track all agents."""
    argparse.ArgumentParser(prog="python -m stages.track", description=__doc__).parse_args()
    track()


if __name__ == "__main__":
    run(main)
