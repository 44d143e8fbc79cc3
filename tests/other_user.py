"""Another user of this machine."""

import json
import os
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

NOBODY = 65534

needs_root = pytest.mark.skipif(os.getuid() != 0, reason="only root may act as another user")


def as_nobody(act: Callable[..., Any], *arguments: Any) -> Any:
    """Run a function in a process of another user; return its result, or what it raised."""
    reading, writing = os.pipe()
    child = os.fork()  # a new program might lie where that user may not read it
    if child == 0:
        try:
            os.setgroups([])
            os.setgid(NOBODY)
            os.setuid(NOBODY)
            result = act(*arguments)
        except BaseException as error:
            result = repr(error)
        os.write(writing, json.dumps(result).encode())
        os._exit(0)
    os.close(writing)
    with open(reading, encoding="utf-8") as pipe:
        told = pipe.read()
    os.waitpid(child, 0)
    return json.loads(told)


def status(
    address: str,
    headers: Mapping[str, str] | None = None,
    method: str = "GET",
    content: bytes | None = None,
) -> int:
    """Ask a server, and return the status of its answer."""
    request = urllib.request.Request(address, content, headers or {}, method=method)
    try:
        with urllib.request.urlopen(request, timeout=30) as response:
            return int(response.status)
    except urllib.error.HTTPError as error:
        return error.code


def ports_connected_to(port: int) -> list[int]:
    """Return the other ports of all connections to a port of this machine, as anyone may know."""
    lines = Path("/proc/net/tcp").read_text(encoding="utf-8").splitlines()[1:]
    ends = [line.split()[1:3] for line in lines]
    return [int(own[-4:], 16) for own, other in ends if other == f"0100007F:{port:04X}"]
