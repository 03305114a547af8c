"""Address and origin of a client, from its WebSocket handshake."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request


def is_handshake(request: Request) -> bool:
    """Return True if an HTTP request is a WebSocket handshake."""
    return any("websocket" in each.lower() for each in request.headers.get_all("Upgrade"))


def server_origin(connection: ServerConnection) -> str:
    """Return the origin of the server's own pages at the address to which the client connected.

    The host is always numeric, because another site can make its own host name resolve to this computer.
    """
    address = connection.local_address
    return f"http://{address[0]}:{address[1]}" if isinstance(address, tuple) else ""


def host_of(connection: ServerConnection) -> str:
    """Return the IP address of the client, without the port."""
    return address_of(connection).rpartition(":")[0]


def origin_of(connection: ServerConnection) -> str | None:
    """Return the origin of a page, or None for a program."""
    request = connection.request
    return None if request is None else request.headers.get("Origin")


def address_of(connection: ServerConnection) -> str:
    """Return the IP address and port of the client."""
    address = connection.remote_address
    return f"{address[0]}:{address[1]}" if isinstance(address, tuple) else str(address)
