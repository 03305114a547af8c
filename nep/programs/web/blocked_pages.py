"""Blocked pages: pages that the user disconnected and that may not connect again."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, NamedTuple

from nep.programs.web.handshake import host_of

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request


_MAX_PAGES = 100


class _Visitor(NamedTuple):
    host: str
    origin: str
    user_agent: str


class BlockedPages:
    """Set of blocked pages, identified by address, origin and User-Agent. Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._visitors: dict[int, _Visitor] = {}

    def add(self, page_id: int, connection: ServerConnection) -> None:
        """Block a page. When more than 100 pages are blocked, the page blocked first is unblocked.

        Args:
            page_id: Id of the page, for `remove`.
            connection: Connection of the page.
        """
        with self._lock:
            self._visitors[page_id] = _visitor(connection, connection.request)
            while len(self._visitors) > _MAX_PAGES:
                del self._visitors[next(iter(self._visitors))]

    def remove(self, page_id: int) -> None:
        """Unblock a page."""
        with self._lock:
            self._visitors.pop(page_id, None)

    def is_blocked(self, connection: ServerConnection, request: Request) -> bool:
        """Return True if the page that sent a handshake is blocked."""
        with self._lock:
            return _visitor(connection, request) in self._visitors.values()


def _visitor(connection: ServerConnection, request: Request | None) -> _Visitor:
    headers = {} if request is None else request.headers
    return _Visitor(host_of(connection), headers.get("Origin", ""), headers.get("User-Agent", ""))
