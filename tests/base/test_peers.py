"""The user at the other end of a connection within this machine."""

import os
import socket
import threading

import pytest
from other_user import NOBODY, as_nobody, needs_root

from jumping_ant.base import peers


@pytest.mark.parametrize("family", [socket.AF_INET, socket.AF_INET6])
def test_the_user_of_a_connection_is_known_while_it_lasts(family: socket.AddressFamily) -> None:
    """Java's programs, among others, connect to IPv4 addresses over IPv6."""
    with socket.create_server(("127.0.0.1", 0)) as server, socket.socket(family) as client:
        place = server.getsockname()
        host = "127.0.0.1" if family == socket.AF_INET else "::ffff:127.0.0.1"
        client.connect((host, place[1]))
        own_end, client_place = server.accept()
        with own_end:
            assert peers.user_of(client_place, place) == os.getuid()
            assert peers.is_own(client_place, place)
            client.close()
            assert peers.user_of(client_place, place) is None, "nobody's, or root's"
            assert not peers.is_own(client_place, place)


def connect_and_wait(place: tuple[str, int]) -> list[int]:
    with socket.create_connection(place, timeout=10) as client:
        return list(client.recv(1))


@needs_root
def test_another_user_is_not_taken_for_this_one() -> None:
    seen: list[object] = []

    def answer(server: socket.socket) -> None:
        connection, name = server.accept()
        with connection:
            place = server.getsockname()
            seen.extend([peers.user_of(name, place), peers.is_own(name, place)])
            connection.sendall(b"!")

    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=answer, args=[server], daemon=True)
        thread.start()
        assert as_nobody(connect_and_wait, server.getsockname()) == list(b"!")
        thread.join(10)
    assert seen == [NOBODY, False]
