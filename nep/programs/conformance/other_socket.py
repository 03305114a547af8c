"""Listener that imitates a ZeroMQ socket of a kind that the client doesn't expect at an address."""

from __future__ import annotations

import contextlib
import socket as sockets
import sys

from nep.programs.conformance.ports import retry_bind

_GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x00NULL".ljust(23, b"\0") + bytes(32)


class OtherSocket:
    """Listener that completes the ZMTP 3.0 handshake as a socket of the given type.

    The client's library disconnects by itself, because the types don't match. A real ZeroMQ socket would
    cause a race: libzmq reconnects if the other side has disconnected, but not if it has disconnected
    itself.

    Args:
        endpoint: Endpoint to listen at.
        kind: Type of the socket, such as ``PUB``.
    """

    def __init__(self, endpoint: str, kind: str) -> None:
        host, _colon, port = endpoint.removeprefix("tcp://").rpartition(":")
        properties = b"\x0bSocket-Type" + len(kind).to_bytes(4, "big") + kind.encode()
        body = b"\x05READY" + properties
        self._handshake = _GREETING + bytes([4, len(body)]) + body
        self._clients: list[sockets.socket] = []
        self._listener = sockets.socket()
        if sys.platform != "win32":  # on Windows, the option allows binding a port in use
            self._listener.setsockopt(sockets.SOL_SOCKET, sockets.SO_REUSEADDR, 1)
        self._listener.setblocking(False)
        try:
            retry_bind(lambda: self._listener.bind((host, int(port))))
            self._listener.listen()
        except OSError:
            self._listener.close()
            raise

    def has_disconnected(self) -> bool:
        """Accept pending clients; return True if one of them has disconnected."""
        with contextlib.suppress(BlockingIOError):
            while True:
                client, _address = self._listener.accept()
                client.setblocking(False)
                client.send(self._handshake)
                self._clients.append(client)
        return any(_is_disconnected(each) for each in self._clients)

    def close(self) -> None:
        """Close the listener and all connections."""
        for connection in (self._listener, *self._clients):
            connection.close()


def _is_disconnected(client: sockets.socket) -> bool:
    try:
        while client.recv(4096):
            pass
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True
