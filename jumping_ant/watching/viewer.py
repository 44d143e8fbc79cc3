"""The files of Rerun's viewer for browsers, which Rerun keeps inside its program."""

import http.client
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from jumping_ant.base.errors import WorkerError

HOST = "127.0.0.1"
START_SECONDS = 30.0  # limit for the program's start
PAGE = ""
CONTENT_TYPES = {
    PAGE: "text/html",
    "re_viewer.js": "text/javascript",
    "re_viewer_bg.wasm": "application/wasm",
    "favicon.ico": "image/x-icon",
    "apple-touch-icon.png": "image/png",
}


def read_files() -> dict[str, bytes]:
    """Return the content of the files in `CONTENT_TYPES`, whose page finds the others beside it."""
    with _serving() as port:
        connection = http.client.HTTPConnection(HOST, port, timeout=START_SECONDS)
        files = {}
        for name in CONTENT_TYPES:
            connection.request("GET", f"/{name}")
            answer = connection.getresponse()
            files[name] = answer.read()
            if answer.status != http.HTTPStatus.OK:
                raise WorkerError(f"the Rerun viewer has no {name!r}; run `make install`")
        connection.close()
    return files


@contextmanager
def _serving() -> Iterator[int]:
    """Have Rerun serve its viewer, and nothing else; yields the port, chosen by the system."""
    # It would also open a port for data, were it not given a place that has them.
    command = [
        *(str(Path(sys.executable).with_name("rerun")), "--serve-web", "--bind", HOST),
        *("--web-viewer-port", "0", f"http://{HOST}/unused.rrd"),
    ]
    process = subprocess.Popen(
        command,
        env=os.environ | {"CI": "1", "RUST_LOG": "info"},  # no telemetry; the port is logged
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        start_new_session=True,  # Ctrl-C reaches only this process, which stops the server
    )
    limit = threading.Timer(START_SECONDS, _stop, [process])
    limit.start()
    try:
        yield _port(process)
    finally:
        limit.cancel()
        _stop(process)
        process.communicate()


def _port(process: subprocess.Popen[str]) -> int:
    for line in process.stdout or ():
        if found := re.search(rf"web-viewer at http://{HOST}:(\d+)", line):
            return int(found[1])
    raise WorkerError("the Rerun viewer does not start; `rerun --serve-web` says why")


def _stop(process: subprocess.Popen[str]) -> None:
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGTERM)  # the command starts the server as its child
