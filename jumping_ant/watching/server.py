"""A Rerun viewer for the browser of the user who starts it: other users are refused.

Rerun's own server takes data from, and gives it to, whoever can connect. Here the browser loads a
growing recording over HTTP instead, from the server that has the viewer's page. That would send
telemetry and fetch fonts from elsewhere, so a content security policy lets it reach only this one.
"""

import hmac
import http.server
import secrets
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from typing import Any
from urllib.parse import quote

import rerun as rr

from jumping_ant.base import peers
from jumping_ant.recording.file import APPLICATION_ID
from jumping_ant.watching import viewer
from jumping_ant.watching.feed import Feed

HOST = "127.0.0.1"
RECORDING = "live.rrd"
POLICY = "default-src 'self' blob: data: 'unsafe-inline' 'unsafe-eval'"
MOST_CONNECTIONS = 64  # at a time
SECONDS_FOR_REQUEST = 30
TOKEN_BYTES = 16


@contextmanager
def serve(name: str) -> Iterator[tuple[rr.RecordingStream, Feed, str]]:
    """Serve a recording; yield it, the feed that publishes its content, and the address to open."""
    files = viewer.read_files()
    with rr.RecordingStream(APPLICATION_ID) as stream:
        feed = Feed(stream)
        stream.send_recording_name(name)
        stream.set_log_time_enabled(False)
        with _Server(files, feed) as server:
            threading.Thread(target=server.serve_forever, daemon=True).start()
            try:
                yield stream, feed, server.address
            finally:
                feed.end()
                server.shutdown()


class _Server(http.server.ThreadingHTTPServer):
    """A server of the viewer and a recording, with a thread for each of a number of connections."""

    request_queue_size = MOST_CONNECTIONS

    def __init__(self, files: dict[str, bytes], feed: Feed) -> None:
        super().__init__((HOST, 0), _Handler)
        self.files, self.feed, self.token = files, feed, secrets.token_hex(TOKEN_BYTES)
        self.names = {f"{name}:{self.server_port}" for name in (HOST, "localhost")}
        self._free = threading.BoundedSemaphore(MOST_CONNECTIONS)

    @property
    def address(self) -> str:
        """The address of the viewer, which shows the recording."""
        root = f"http://{HOST}:{self.server_port}/{self.token}/"
        return f"{root}?url={quote(root + RECORDING, safe='')}&hide_welcome_screen&theme=dark"

    def verify_request(self, request: Any, client_address: Any) -> bool:
        """Hang up on other users of the machine, before they take a place."""
        return peers.is_own(client_address, (HOST, self.server_port))

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection in a thread of its own, or close it if there are too many."""
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve a connection, in its thread."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Report an error, unless the browser has disconnected or fallen silent."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Handler(http.server.BaseHTTPRequestHandler):
    server: _Server
    timeout = SECONDS_FOR_REQUEST

    def do_GET(self) -> None:  # noqa: N802  (the base class's name)
        path = self.path.partition("?")[0]
        token, slash, name = path.removeprefix("/").partition("/")
        # A page elsewhere could give its own name this machine's address.
        if self.headers["Host"] not in self.server.names:
            self.send_error(HTTPStatus.MISDIRECTED_REQUEST)
        elif not hmac.compare_digest(token.encode(), self.server.token.encode()):
            self.send_error(HTTPStatus.FORBIDDEN, explain="Open the address that was printed.")
        elif name == RECORDING:
            self._send("application/octet-stream", self.server.feed.follow())
        elif slash and name in self.server.files:
            self._send(viewer.CONTENT_TYPES[name], [self.server.files[name]])
        else:
            self.send_error(HTTPStatus.NOT_FOUND)

    def _send(self, content_type: str, parts: Iterable[bytes]) -> None:
        """Send content up to the end of the connection."""
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", content_type)
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        for part in parts:
            self.wfile.write(part)

    def log_message(self, format: str, *args: object) -> None:
        """Log nothing."""
