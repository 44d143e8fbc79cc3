"""Bring MLflow up to date, and serve its pages to who has the address that is printed.

Usage: python -m jumping_ant.tracking.ui [--port PORT]

MLflow's server lets in every user of the machine. So the address has a token, new at each start,
which clients of MLflow send if it is `MLFLOW_TRACKING_TOKEN`. If `MLFLOW_TRACKING_URI` names a
server, that one has the pages, and only the update is made.
"""

import logging
import os
import resource
import secrets
import socket
import warnings
from collections.abc import Awaitable, Callable, MutableMapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import uvicorn
from starlette.requests import HTTPConnection
from starlette.responses import HTMLResponse, PlainTextResponse
from uvicorn.protocols.http.h11_impl import H11Protocol

from jumping_ant.base import command_line
from jumping_ant.base.errors import InputError, reported
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.base.paths import home
from jumping_ant.tracking import connection
from jumping_ant.tracking.mirror import track

HOST = "127.0.0.1"
TOKEN_BYTES = 16
SECONDS_FOR_REQUEST = 5.0  # before a connection that asks nothing is closed
UNKNOWN = "Open the address that `make ui` printed, or set MLFLOW_TRACKING_TOKEN to its token.\n"
# Takes the token out of the address bar and out of the tab's history.
ENTRANCE = '<script>location.replace("/" + location.hash)</script>'

Application = Callable[[MutableMapping[str, Any], Any, Any], Awaitable[None]]


class Impatient(H11Protocol):
    """Closes connections that ask nothing, with which others could use up this process's files."""

    def connection_made(self, transport: Any) -> None:
        """Begin to wait for a request."""
        super().connection_made(transport)
        self.loop.call_later(SECONDS_FOR_REQUEST, self._close_if_idle)

    def _close_if_idle(self) -> None:
        cycle: Any = self.cycle  # None before the first request, whatever its type says
        if cycle is None:
            self.transport.close()


def with_token(application: Application, token: str, port: int) -> Application:
    """Return an ASGI application that answers only requests with a token, of its own pages.

    The printed address leaves the token in a cookie, which all ports of a machine would get: its
    name has the port.
    """
    cookie = f"jumping-ant-{port}"

    def is_token(text: str | None) -> bool:
        return secrets.compare_digest((text or "").encode(), token.encode())

    async def respond(scope: MutableMapping[str, Any], receive: Any, send: Any) -> None:
        answer = application
        if scope["type"] != "lifespan":
            request = HTTPConnection(scope)
            kind, _, bearer = request.headers.get("authorization", "").partition(" ")
            is_known = is_token(request.cookies.get(cookie) or (bearer if kind == "Bearer" else ""))
            site = f"http://{request.headers.get('host', '')}"
            if request.headers.get("origin", site) != site:
                answer = PlainTextResponse("This server answers only its own pages.\n", 403)
            elif scope["path"] == "/" and is_token(request.query_params.get("token")):
                headers = {"Cache-Control": "no-store", "Referrer-Policy": "no-referrer"}
                answer = HTMLResponse(ENTRANCE, headers=headers)
                # A strict cookie would be kept back when a link in the report is followed.
                answer.set_cookie(cookie, token, httponly=True, samesite="lax")
            elif not is_known:
                answer = PlainTextResponse(UNKNOWN, 403)
        await answer(scope, receive, send)

    return respond


def main() -> None:
    """Parse the command line, update, and serve until Ctrl-C."""
    parser = command_line.parser(__doc__, "python -m jumping_ant.tracking.ui")
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
        port = listener.getsockname()[1]
        track(root, pages_at=f"http://{HOST}:{port}/?token={token}")
        print("Ctrl-C ends the server", flush=True)
        guarded = with_token(_pages(uri, connection.artifacts_uri(home(root))), token, port)
        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
        logging.getLogger("asyncio").setLevel(logging.CRITICAL)  # a traceback for each refusal
        settings: Any = {"ws": "none", "http": Impatient, "workers": 1, "log_level": "warning"}
        config = uvicorn.Config(guarded, **settings)
        uvicorn.Server(config).run([listener])


def _pages(database_uri: str, artifacts_uri: str) -> Any:
    """Return MLflow's server, an ASGI application, without its proxy for artifacts."""
    os.environ |= {  # which MLflow 3.17 sets for its own server
        "_MLFLOW_SERVER_FILE_STORE": database_uri,
        "_MLFLOW_SERVER_ARTIFACT_ROOT": artifacts_uri,
        "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false",
    }
    with warnings.catch_warnings(action="ignore"):  # about packages that MLflow uses
        from mlflow.server.fastapi_app import app  # reads the variables
    return app


def _listen(port: int) -> socket.socket:
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
