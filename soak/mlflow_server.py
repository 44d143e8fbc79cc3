"""An MLflow server, as docs/shared.md starts it, that can be killed and restarted."""

import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

HOST = "127.0.0.1"
SECONDS_TO_START = 180.0


class Server:
    """A server with a folder, for its log and artifacts, and a database, by its URI."""

    def __init__(self, folder: Path, database: str) -> None:
        with socket.create_server((HOST, 0)) as probe:
            port: int = probe.getsockname()[1]
        self.uri = f"http://{HOST}:{port}"
        self._folder = folder
        self._command = [sys.executable, "-m", "mlflow", "server", "--workers", "1"]
        self._command += ["--host", HOST, "--port", str(port), "--backend-store-uri", database]
        self._command += ["--artifacts-destination", str(folder / "files")]
        self.start()

    def start(self) -> None:
        """Start, and wait until it answers."""
        with (self._folder / "server.log").open("ab") as log:
            self._process = subprocess.Popen(
                self._command,
                cwd=self._folder,
                # Seven processes less.
                env=os.environ | {"MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false"},
                stdout=log,
                stderr=log,
                start_new_session=True,  # a group, as it has processes of its own
            )
        deadline = time.monotonic() + SECONDS_TO_START
        while not self._answers():
            if self._process.poll() is not None or time.monotonic() > deadline:
                self.kill()
                log_path = self._folder / "server.log"
                raise RuntimeError(log_path.read_text(encoding="utf-8")[-2000:])
            time.sleep(0.1)

    def kill(self) -> None:
        """Kill all its processes."""
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def _answers(self) -> bool:
        try:
            with urllib.request.urlopen(f"{self.uri}/health", timeout=5) as response:
                return bool(response.status == 200)
        except OSError:
            return False


@contextmanager
def running(folder: Path, database: str) -> Iterator[Server]:
    """Run a server in a folder, which is created, with the database of a URI."""
    folder.mkdir(exist_ok=True)
    server = Server(folder, database)
    try:
        yield server
    finally:
        server.kill()
