"""MLflow's server, for the user who starts it: other users of the machine are refused.

MLflow asks nobody who they are. Whoever may send it requests can upload files, and make them a
champion that the user then loads. Here a request must come from a process of the user and bring
the server's token, each of which would be enough by itself.
"""

import hmac
import socket
from collections.abc import Awaitable, Callable, MutableMapping
from pathlib import Path
from typing import Any

import uvicorn
from starlette.requests import HTTPConnection
from starlette.responses import HTMLResponse, PlainTextResponse

from jumping_ant.base import peers
from jumping_ant.base.paths import home
from jumping_ant.tracking import internals
from jumping_ant.tracking.connection import artifacts_uri

Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Application = Callable[[Message, Receive, Send], Awaitable[None]]

UNKNOWN = "Open the address that `make ui` printed, or set MLFLOW_TRACKING_TOKEN to its token."
# Takes the token out of the address bar and out of the tab's history.
ENTRANCE = '<script>location.replace("/" + location.hash)</script>'


class OwnUserOnly:
    """An ASGI application that answers only its user, told by the kernel and by a token.

    The token arrives in the address of the page, which leaves it in a cookie, or as clients of
    MLflow send `MLFLOW_TRACKING_TOKEN`. All ports of a machine share their cookies: this one's name
    has the port, and no page of another port may have the browser use it.
    """

    def __init__(self, application: Application, token: str, port: int) -> None:
        self._application, self._token = application, token
        self._cookie = f"jumping-ant-{port}"

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """Answer a request."""
        answer = self._application
        if scope["type"] != "lifespan":
            request = HTTPConnection(scope)
            refusal = self._refusal(request)
            if refusal:
                answer = PlainTextResponse(f"{refusal}\n", 403)
            elif self._is_entrance(request):
                answer = self._entrance()
        await answer(scope, receive, send)

    def _refusal(self, request: HTTPConnection) -> str | None:
        client, server = request.scope["client"], request.scope["server"]
        if client is None or not peers.is_own(tuple(client), tuple(server)):
            return "This server is another user's."
        if _is_of_another_page(request):
            return "This server answers only its own pages."
        if not (self._is_entrance(request) or self._is_known(request)):
            return UNKNOWN
        return None

    def _is_entrance(self, request: HTTPConnection) -> bool:
        """Tell whether it is a visit to the address that `make ui` printed."""
        return request.scope["path"] == "/" and self._is_token(request.query_params.get("token"))

    def _is_known(self, request: HTTPConnection) -> bool:
        kind, _, token = request.headers.get("authorization", "").partition(" ")
        is_sent = kind.lower() == "bearer" and self._is_token(token)
        return is_sent or self._is_token(request.cookies.get(self._cookie))

    def _is_token(self, given: str | None) -> bool:
        return hmac.compare_digest((given or "").encode(), self._token.encode())

    def _entrance(self) -> HTMLResponse:
        headers = {"Cache-Control": "no-store", "Referrer-Policy": "no-referrer"}
        page = HTMLResponse(ENTRANCE, headers=headers)
        # A strict cookie would be kept back when a link in the report is followed.
        page.set_cookie(self._cookie, self._token, httponly=True, samesite="lax")
        return page


def _is_of_another_page(request: HTTPConnection) -> bool:
    """Tell whether a page from elsewhere, perhaps of another port, has the browser ask.

    It may lead there by a link; neither may it send a form nor show pages from here in a frame.
    """
    headers = request.headers
    origin, host = headers.get("origin"), headers.get("host", "")
    if origin is not None and origin.partition("://")[2] != host:
        return True
    is_link = (
        request.scope["method"] == "GET"
        and headers.get("sec-fetch-mode") == "navigate"
        and headers.get("sec-fetch-dest", "document") == "document"
    )
    return headers.get("sec-fetch-site") in ("cross-site", "same-site") and not is_link


def serve(listener: socket.socket, uri: str, root: Path, token: str) -> None:
    """Serve a project's database to whoever brings a token (see `OwnUserOnly`), until Ctrl-C."""
    application = internals.server(uri, artifacts_uri(home(root)))
    guarded = OwnUserOnly(application, token, listener.getsockname()[1])
    # Proxies may say whom they ask for, and so could anyone here: headers would replace the address
    # that the user is found by.
    config = uvicorn.Config(guarded, proxy_headers=False, ws="none", workers=1, log_level="warning")
    uvicorn.Server(config).run([listener])
