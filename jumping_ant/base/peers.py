"""Which user is at the other end of a connection within this machine, as the kernel knows it."""

import os
import socket
import struct
from pathlib import Path

Address = tuple[str, int]  # IPv4 address and port

CONNECTIONS = Path("/proc/net/tcp")
CONNECTIONS_OVER_IPV6 = Path("/proc/net/tcp6")
MAPPED = b"\0" * 10 + b"\xff" * 2  # an IPv4 address as an IPv6 one, which some programs connect by
ESTABLISHED = "01"
ROOT = 0


def is_own(client: Address, server: Address) -> bool:
    """Tell whether a connection comes from this process's user or from root.

    On systems without `/proc/net/tcp` users cannot be told apart, and all pass.
    """
    return not CONNECTIONS.exists() or user_of(client, server) in (os.getuid(), ROOT)


def user_of(client: Address, server: Address) -> int | None:
    """Return the id of the user at a connection's other end, `client`.

    It is None if the connection is closed, even by half, or comes from another machine.
    """
    for table, prefix in ((CONNECTIONS, b""), (CONNECTIONS_OVER_IPV6, MAPPED)):
        ends = [_entry(prefix, client), _entry(prefix, server)]
        lines = table.read_text(encoding="utf-8").splitlines() if table.exists() else []
        for line in lines[1:]:
            fields = line.split()
            if fields[1:3] == ends and fields[3] == ESTABLISHED:  # others have lost their owner
                return int(fields[7])
    return None


def _entry(prefix: bytes, address: Address) -> str:
    """Return an address as the kernel prints it: words in this machine's order of bytes."""
    host = prefix + socket.inet_aton(address[0])
    words = struct.unpack(f"={len(host) // 4}I", host)
    return "".join(f"{word:08X}" for word in words) + f":{address[1]:04X}"
