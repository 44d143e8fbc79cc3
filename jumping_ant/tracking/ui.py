"""Bring MLflow up to date, and serve its pages to this user on this machine.

Usage: python -m jumping_ant.tracking.ui [--port PORT]

If `MLFLOW_TRACKING_URI` names a server, that one has the pages, and only the update is made.
"""

import argparse
import os
import sys
from pathlib import Path

from jumping_ant.base.errors import reported
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.base.paths import home
from jumping_ant.tracking import connection
from jumping_ant.tracking.mirror import track

HOST = "127.0.0.1"


def main() -> None:
    """Parse the command line, update, and become the server."""
    parser = argparse.ArgumentParser(prog="python -m jumping_ant.tracking.ui", description=__doc__)
    parser.add_argument("--port", type=int, default=5000)
    port = parser.parse_args().port
    with reported():
        track(pages_at=f"http://{HOST}:{port}")
        uri = connection.tracking_uri()
        if not connection.is_server(uri):
            print("as soon as MLflow's server is up; Ctrl-C ends it", flush=True)
            serve(uri, PROJECT_ROOT, port)


def serve(uri: str, root: Path, port: int) -> None:
    """Replace this process by MLflow's server, without its proxy for artifacts.

    The server refuses other users (see `jumping_ant.tracking.own_pages`).

    Args:
        uri: The database. It may hold a password, so it is no argument, which others could read.
        root: The project folder.
        port: Port to listen on.
    """
    variables = {"MLFLOW_BACKEND_STORE_URI": uri, "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false"}
    os.environ.update(variables)
    command = [
        *(sys.executable, "-m", "mlflow", "server"),
        *("--host", HOST, "--port", str(port), "--workers", "1"),
        *("--app-name", "jumping-ant", "--no-serve-artifacts"),
        *("--default-artifact-root", (home(root) / "mlartifacts").as_uri()),
    ]
    os.execv(command[0], command)


if __name__ == "__main__":
    main()
