"""Bring MLflow up to date, and serve its pages to this user on this machine.

Usage: python -m jumping_ant.tracking.ui [--port PORT]

The address that it prints has a token, new at each start. Clients of MLflow send it if
`MLFLOW_TRACKING_TOKEN` is set to it. If `MLFLOW_TRACKING_URI` names a server, that one has the
pages, and only the update is made.
"""

import argparse
import secrets
import socket
from contextlib import suppress
from pathlib import Path

from jumping_ant.base.errors import InputError, reported
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.tracking import connection
from jumping_ant.tracking.mirror import track
from jumping_ant.tracking.own_pages import serve

HOST = "127.0.0.1"
TOKEN_BYTES = 16


def main() -> None:
    """Parse the command line, update, and serve until Ctrl-C."""
    parser = argparse.ArgumentParser(prog="python -m jumping_ant.tracking.ui", description=__doc__)
    parser.add_argument("--port", type=int, default=5000)
    port = parser.parse_args().port
    with reported(), suppress(KeyboardInterrupt):
        run(PROJECT_ROOT, port)


def run(root: Path, port: int) -> None:
    """Bring MLflow up to date with a project, print where to look, and serve until Ctrl-C."""
    uri = connection.tracking_uri(root)
    if connection.is_server(uri):
        track(root, pages_at=uri)
        return
    token = secrets.token_hex(TOKEN_BYTES)
    with _listen(port) as listener:  # before the address is printed: nobody else may answer there
        place = f"{HOST}:{listener.getsockname()[1]}"
        track(root, pages_at=f"http://{place}/?token={token}")
        print("Ctrl-C ends the server", flush=True)
        serve(listener, uri, root, token)


def _listen(port: int) -> socket.socket:
    """Return a socket that accepts connections from this machine."""
    try:
        return socket.create_server((HOST, port))
    except (OSError, OverflowError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a port"
        raise InputError(
            f"--port: given {port} ({reason}), allowed: a free port up to 65535; "
            "`make ui PORT=8080` takes another"
        ) from error


if __name__ == "__main__":
    main()
