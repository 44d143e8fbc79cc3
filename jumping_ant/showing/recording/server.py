"""A Rerun viewer for browsers on this machine only.

Rerun's Python functions would listen on every network, so its command serves, bound to the loopback
address. Its page would send telemetry and fetch fonts from elsewhere, so a proxy serves it with a
content security policy that lets browsers reach only the two servers here.
"""

import http.server
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.parse import quote

import rerun as rr

from jumping_ant.base.errors import WorkerError
from jumping_ant.showing.recording.file import APPLICATION_ID

HOST = "127.0.0.1"
START_SECONDS = 30.0  # limit for the start of the server
MOST_CONNECTIONS = 64  # at a time
SECONDS_FOR_REQUEST = 30
MEMORY = "512MiB"  # of history that the server keeps for browsers that connect late


@contextmanager
def serve(name: str) -> Iterator[tuple[rr.RecordingStream, str]]:
    """Serve a recording while the context is open.

    Args:
        name: Its name in the viewer.

    Yields:
        The recording to log to, and the address to open.

    Raises:
        WorkerError: The server does not start.
    """
    data_port, viewer_port = _free_ports(2)
    data = f"{HOST}:{data_port}/proxy"
    with (
        _rerun(data_port, viewer_port),
        _guarded(viewer_port, data_port) as address,
        rr.RecordingStream(APPLICATION_ID) as stream,
    ):
        stream.connect_grpc(f"rerun+http://{data}")
        stream.send_recording_name(name)
        stream.set_log_time_enabled(False)
        url = quote(f"rerun+http://{data}", safe="")
        try:
            yield stream, f"{address}/?url={url}&hide_welcome_screen&theme=dark"
        finally:
            stream.disconnect()  # before the server ends, or it would complain


@contextmanager
def _rerun(data_port: int, viewer_port: int) -> Iterator[None]:
    """Run Rerun's server, which forwards logged data to browsers and serves the viewer."""
    command = [
        str(Path(sys.executable).with_name("rerun")),
        "--serve-web",
        *("--bind", HOST, "--port", str(data_port), "--web-viewer-port", str(viewer_port)),
        *("--server-memory-limit", MEMORY),
    ]
    process = subprocess.Popen(
        command,
        env=os.environ | {"CI": "1"},  # disables Rerun's telemetry
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C reaches only this process, which stops the server
    )
    try:
        _await_ports(process, data_port, viewer_port)
        yield
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)  # the command starts the server as its child
        process.wait()


@contextmanager
def _guarded(viewer_port: int, data_port: int) -> Iterator[str]:
    """Serve the viewer's page with the policy; yields the page's address."""
    places = f"'self' blob: data: http://{HOST}:{data_port}"
    policy = f"default-src {places} 'unsafe-inline' 'unsafe-eval'"
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))  # local, so no proxy

    class Handler(http.server.BaseHTTPRequestHandler):
        timeout = SECONDS_FOR_REQUEST

        def do_GET(self) -> None:  # noqa: N802  (the base class's name)
            if not self.path.startswith("/"):  # could name another host
                self.send_error(HTTPStatus.BAD_REQUEST)
                return
            # A page elsewhere could give its own name this machine's address.
            if self.headers["Host"] not in names:
                self.send_error(HTTPStatus.MISDIRECTED_REQUEST)
                return
            try:
                answer = opener.open(f"http://{HOST}:{viewer_port}{self.path}")
            except urllib.error.HTTPError as error:
                self.send_error(error.code)
                return
            except urllib.error.URLError:
                self.send_error(HTTPStatus.BAD_GATEWAY)
                return
            with answer, suppress(ConnectionError):  # the browser has disconnected
                self.send_response(200)
                self.send_header("Content-Type", answer.headers["Content-Type"])
                self.send_header("Content-Security-Policy", policy)
                self.end_headers()
                shutil.copyfileobj(answer, self.wfile)

        def log_message(self, format: str, *args: object) -> None:
            """Log nothing."""

    with _Server((HOST, 0), Handler) as server:
        names = {f"{name}:{server.server_port}" for name in (HOST, "localhost")}
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://{HOST}:{server.server_port}"
        finally:
            server.shutdown()


class _Server(http.server.ThreadingHTTPServer):
    """A server of a thread for each connection, up to a number of connections."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._free = threading.BoundedSemaphore(MOST_CONNECTIONS)

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


def _await_ports(process: subprocess.Popen[bytes], *ports: int) -> None:
    deadline = time.monotonic() + START_SECONDS
    for port in ports:
        while not _listens(port):
            if process.poll() is not None or time.monotonic() > deadline:
                raise WorkerError("the Rerun server does not start; `rerun --serve-web` says why")
            time.sleep(0.05)


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex((HOST, port)) == 0


def _free_ports(count: int) -> list[int]:
    sockets = [socket.socket() for _ in range(count)]
    try:
        for one in sockets:
            one.bind((HOST, 0))
        return [one.getsockname()[1] for one in sockets]
    finally:
        for one in sockets:
            one.close()
