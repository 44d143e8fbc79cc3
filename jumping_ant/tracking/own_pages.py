"""MLflow's server, for the user who starts it: other users of the machine are refused.

MLflow asks nobody who they are. Whoever may send it requests can upload files, and make them a
champion that the user then loads. `mlflow server --app-name jumping-ant` serves the `app` here.
"""

import os
import socket
import sys
from collections.abc import Awaitable, Callable, MutableMapping
from pathlib import Path
from typing import Any

from mlflow.server.fastapi_app import app as mlflow_app

Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Application = Callable[[Message, Receive, Send], Awaitable[None]]
Address = tuple[str, int]

CONNECTIONS = Path("/proc/net/tcp")
ESTABLISHED = "01"
ROOT = 0


class OwnUserOnly:
    """An ASGI application that answers only requests of this process's user and of root.

    On systems without `/proc/net/tcp` it cannot tell users apart, and answers all.
    """

    def __init__(self, application: Application) -> None:
        self._application = application

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] == "lifespan" or _is_allowed(scope):
            await self._application(scope, receive, send)
        elif scope["type"] == "http":
            text = [(b"content-type", b"text/plain")]
            await send({"type": "http.response.start", "status": 403, "headers": text})
            await send({"type": "http.response.body", "body": b"This server is another user's.\n"})
        else:
            await send({"type": "websocket.close", "code": 1008})


def _is_allowed(scope: Message) -> bool:
    if not CONNECTIONS.exists():
        return True
    user = user_of(tuple(scope["client"]), tuple(scope["server"]))
    return user in (os.getuid(), ROOT)


def user_of(client: Address, server: Address) -> int | None:
    """Return the id of the user at the other end of a connection within this machine.

    Args:
        client: IPv4 address and port of the other end.
        server: Those of this end.

    Returns:
        None if the connection is closed or comes from another machine.
    """
    ends = [_entry(client), _entry(server)]
    for line in CONNECTIONS.read_text(encoding="utf-8").splitlines()[1:]:
        fields = line.split()
        if fields[1:3] == ends and fields[3] == ESTABLISHED:  # others have lost their owner
            return int(fields[7])
    return None


def _entry(address: Address) -> str:
    """Return an address as the kernel prints it."""
    host = int.from_bytes(socket.inet_aton(address[0]), sys.byteorder)
    return f"{host:08X}:{address[1]:04X}"


app = OwnUserOnly(mlflow_app)
