"""Debian's Firefox without a screen, spoken to in WebDriver BiDi (https://w3c.github.io/webdriver-bidi)."""

import base64
import itertools
import json
import re
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

SECONDS = 120.0  # that an answer or a page may take: other tests run beside this one
SETTINGS = {"webgl.force-enabled": True}  # also where there is only Mesa's software renderer
HEARD = ("log.entryAdded", "network.beforeRequestSent")


class Window:
    """A window of Firefox that notes what its pages ask for and complain about.

    Attributes:
        requests: The address of everything they asked for, `data:` and `blob:` left out.
        errors: Errors in the console, exceptions among them.
    """

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection
        self._numbers = itertools.count()
        self.requests: list[str] = []
        self.errors: list[str] = []
        self._call("session.new", capabilities={})
        self._call("session.subscribe", events=list(HEARD))
        (top,) = self._call("browsingContext.getTree")["contexts"]
        self._context = top["context"]

    def open(self, address: str, width: int = 1400, height: int = 900) -> None:
        """Open an address in a window of a size."""
        size = {"width": width, "height": height}
        self._call("browsingContext.setViewport", context=self._context, viewport=size)
        self._call("browsingContext.navigate", context=self._context, url=address, wait="complete")

    def evaluate(self, expression: str) -> Any:
        """Return the value of an expression of JSON values, or of a promise of one."""
        answer = self._call(
            "script.evaluate",
            expression=f"Promise.resolve({expression}).then((own) => JSON.stringify(own ?? null))",
            target={"context": self._context},
            awaitPromise=True,
        )
        assert answer["type"] == "success", answer
        return json.loads(answer["result"]["value"])

    def wait_for(self, condition: str, seconds: float = SECONDS) -> None:
        """Wait until an expression is true."""
        deadline = time.monotonic() + seconds
        while not self.evaluate(condition):
            assert time.monotonic() < deadline, condition
            time.sleep(0.05)

    def screenshot(self, path: Path) -> None:
        """Write a picture of the whole page."""
        answer = self._call(
            "browsingContext.captureScreenshot", context=self._context, origin="document"
        )
        path.write_bytes(base64.b64decode(answer["data"]))

    def _call(self, method: str, **params: Any) -> dict[str, Any]:
        number = next(self._numbers)
        self._connection.send(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            message = json.loads(self._connection.recv(SECONDS))
            if message.get("id") == number:
                assert message["type"] == "success", message
                result: dict[str, Any] = message["result"]
                return result
            self._note(message)

    def _note(self, event: dict[str, Any]) -> None:
        params = event.get("params", {})
        if event.get("method") == "log.entryAdded" and params["level"] == "error":
            self.errors.append(params["text"])
        if event.get("method") == "network.beforeRequestSent":
            address = params["request"]["url"]
            if not address.startswith(("data:", "blob:")):
                self.requests.append(address)


@contextmanager
def launched(profile: Path) -> Iterator[Window]:
    """Run Firefox with a new profile, which no test may go without."""
    path = shutil.which("firefox-esr") or shutil.which("firefox")
    assert path, "no firefox here; run `scripts/environment.sh browser`"
    profile.mkdir()
    lines = (f"user_pref({json.dumps(name)}, {json.dumps(own)});" for name, own in SETTINGS.items())
    (profile / "user.js").write_text("\n".join(lines), encoding="utf-8")
    command = [path, "--headless", "--no-remote", "--profile", str(profile)]
    command += ["--remote-debugging-port", "0", "about:blank"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, encoding="utf-8") as process:
        try:
            assert process.stderr
            told = (re.search(r"BiDi listening on (ws:\S+)", line) for line in process.stderr)
            address = next(match[1] for match in told if match)
            with connect(f"{address}/session", max_size=None) as connection:
                yield Window(connection)
        finally:
            process.terminate()
