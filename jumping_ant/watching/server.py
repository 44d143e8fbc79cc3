"""The live page over the native simulator, for the user who starts it: other users are refused.

A page gets simulations of its own. Its security policy lets it reach only this server.
"""

import hmac
import json
import secrets
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http import HTTPStatus
from pathlib import Path
from typing import Any

from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.sync import server as websockets
from websockets.typing import Origin

from jumping_ant.base import peers
from jumping_ant.base.errors import InputError
from jumping_ant.experiment.models import Params
from jumping_ant.play import content, page, vendor
from jumping_ant.watching import trained
from jumping_ant.watching.session import Session
from jumping_ant.watching.simulation import Json

HOST = "127.0.0.1"
MODULE = "native.js"
PERIOD = 1 / 60  # [s] from frame to frame
MOST_THREADS = 192  # a connection has up to three
SECONDS_FOR_REQUEST = 2.0
TOKEN_BYTES = 16


@contextmanager
def listen(root: Path, params: Params) -> Iterator[tuple[websockets.Server, str]]:
    """Listen for the user's browser; yield a server, and the address of its page."""
    with _Listener.create() as listener:
        site = _Site(root, params, listener.getsockname()[1])
        serving = websockets.serve(
            site.converse,
            sock=listener,
            origins=[Origin(f"http://{name}") for name in site.names],
            process_request=site.answer,
            compression=None,
            open_timeout=SECONDS_FOR_REQUEST,
        )
        with serving:
            yield serving, f"http://{HOST}:{site.port}/{site.token}/"


class _Listener(socket.socket):
    """A socket that hangs up on other users of the machine, and if there are too many threads."""

    @classmethod
    def create(cls) -> "_Listener":
        return cls(fileno=socket.create_server((HOST, 0)).detach())

    def accept(self) -> tuple[socket.socket, Any]:
        connection, client = super().accept()
        is_own = peers.is_own(client, self.getsockname())
        if not is_own or threading.active_count() > MOST_THREADS:
            connection.close()
        return connection, client


class _Site:
    """What the server's addresses show: the page, policies as JSON, and the simulator."""

    def __init__(self, root: Path, params: Params, port: int) -> None:
        self.port, self.token = port, secrets.token_hex(TOKEN_BYTES)
        self.names = [f"{name}:{port}" for name in (HOST, "localhost")]
        self._root, self._params = root, params
        found = {name: trained.seeds(root, params, name) for name in params.agents}
        seeds = {name: own for name, own in found.items() if own}
        self._policies = {
            f"policies/{agent}/{seed}.json": (agent, seed)
            for agent, own in seeds.items()
            for seed in own
        }
        module = Path(__file__).with_name(MODULE).read_text(encoding="utf-8")
        self._page = page.render(
            content.build(root, params, seeds, is_complete=False),
            {name: own for name, own in vendor.files().items() if not name.startswith("mujoco.")},
            native={MODULE: module},
            servers=" ".join(["'self'", *(f"ws://{name}" for name in self.names)]),
        )

    def answer(self, connection: websockets.ServerConnection, request: Request) -> Response | None:
        """Answer a request, unless it is to open the conversation."""
        token, slash, name = request.path.partition("?")[0].removeprefix("/").partition("/")
        # A page elsewhere could give its own name this machine's address.
        if request.headers.get_all("Host") not in [[name] for name in self.names]:
            return connection.respond(HTTPStatus.MISDIRECTED_REQUEST, "")
        if not hmac.compare_digest(token.encode(errors="replace"), self.token.encode()):
            return connection.respond(HTTPStatus.FORBIDDEN, "Open the address that was printed.\n")
        if name == "live":
            return None
        if slash and not name:
            return _response("text/html; charset=utf-8", self._page)
        if name in self._policies:
            return self._policy(connection, *self._policies[name])
        return connection.respond(HTTPStatus.NOT_FOUND, "")

    def _policy(self, connection: websockets.ServerConnection, agent: str, seed: int) -> Response:
        """Answer with a policy, or why there is none now: perhaps it is being trained again."""
        try:
            policy = content.policy(self._root, agent, seed)
        except (InputError, OSError) as error:
            return connection.respond(HTTPStatus.NOT_FOUND, f"{error}\n")
        return _response("application/json", json.dumps(policy))

    def converse(self, connection: websockets.ServerConnection) -> None:
        """Simulate for a page until it is closed, or says what none says."""
        with suppress(ConnectionClosed):
            try:
                self._simulate(connection)
            except (AttributeError, LookupError, TypeError, ValueError) as error:
                _send(connection, {"kind": "failure", "text": str(error)})

    def _simulate(self, connection: websockets.ServerConnection) -> None:
        session = Session(self._root, self._params)
        answers, due = session.begin(), time.monotonic()
        while True:
            for answer in answers:
                _send(connection, answer)
            try:
                message = connection.recv(timeout=max(0.0, due - time.monotonic()))
                answers = session.hear(json.loads(message))
            except TimeoutError:
                answers = []
            if time.monotonic() >= due:
                answers += session.tick()
                due = time.monotonic() + PERIOD


def _send(connection: websockets.ServerConnection, message: Json) -> None:
    connection.send(json.dumps(message, allow_nan=False, separators=(",", ":")))


def _response(content_type: str, text: str) -> Response:
    body = text.encode()
    headers = Headers(
        {
            "Content-Type": content_type,
            "Content-Length": str(len(body)),
            "Connection": "close",
            "Referrer-Policy": "no-referrer",
            "Cache-Control": "no-store",
        }
    )
    return Response(HTTPStatus.OK, HTTPStatus.OK.phrase, headers, body)
