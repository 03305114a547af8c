"""WebServer: serves pages and programs that speak rosbridge, in a thread of its own with an event loop."""

from __future__ import annotations

import asyncio
import errno
import logging
import socket
import threading
import time
from collections import deque
from collections.abc import Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from nep.errors import AddressInUseError, NepError, TooManyFilesError
from nep.i18n import _
from nep.nodes.node import Node
from nep.programs.robots.guard import MotionGuard
from nep.programs.web.access import Access, AuthCheck, is_own_host
from nep.programs.web.context import ConnectedPage, Refusal, WebCounts
from nep.programs.web.foxglove_page import SUBPROTOCOLS, ChannelFormat, FoxglovePage
from nep.programs.web.limits import MAX_MESSAGE_BYTES, MAX_PAGES
from nep.programs.web.page import Page, authenticate
from nep.system.addresses import ANY
from nep.system.descriptors import is_lack, limit, opened
from nep.system.log_rarely import is_logged
from nep.text import escaped

if TYPE_CHECKING:
    from typing_extensions import Self
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response
    from websockets.typing import Subprotocol

__all__ = ["DEFAULT_PORT", "WebServer", "WebSettings"]

DEFAULT_PORT = 9090
"""Rosbridge's."""
_logger = logging.getLogger("nep.programs.web")
_LOOPBACK = "127.0.0.1"
_NODE_NAME = "nep_web"
_REFRESH_S = 1.0
"""How often the guard looks for robots that came while pages are connected."""
_WAIT_FOR_MASTER_S = 2.0
_OPEN_TIMEOUT_S = 5.0
_CLOSE_TIMEOUT_S = 2.0
_JOIN_S = 10.0
_POLICY_VIOLATION = 1008
_MAX_REFUSALS = 50
_MAX_LOCKED = 16
"""Connections without a token that may still send an ``auth``."""


@dataclass(frozen=True)
class WebSettings:
    """What a server is told.

    `port`: 0 takes a free one. `listen`: addresses of this computer at which others can connect, too; then a
    token is needed. `allow_moving`: names of the robots that pages may move.
    """

    port: int = DEFAULT_PORT
    listen: Collection[str] = ()
    access: Access = field(default_factory=Access)
    allow_moving: Collection[str] = ()
    master: str | None = None
    transport: str = "zeromq"
    foxglove: ChannelFormat | None = None
    """Encodes topics for clients of Foxglove's WebSocket protocol, which only read; None: serve none."""

    @property
    def hosts(self) -> tuple[str, ...]:
        """All addresses at which it answers."""
        if ANY in self.listen:
            return (ANY,)
        return tuple(dict.fromkeys((_LOOPBACK, *self.listen)))

    @property
    def is_open(self) -> bool:
        """Whether other computers can connect."""
        return any(not is_own_host(each) for each in self.hosts)


class WebServer:
    """Serves from `start` until `close`; a context manager.

    `start` raises `AddressInUseError`, and `NepError` for an address that this computer doesn't have, and
    where the libraries are not installed.
    """

    def __init__(self, settings: WebSettings) -> None:
        self.settings = settings
        self.counts = WebCounts()
        self.port = settings.port
        self._pages: set[Page | FoxglovePage] = set()
        self._locked = 0
        self._refusals: deque[Refusal] = deque(maxlen=_MAX_REFUSALS)
        self._auth = AuthCheck(settings.access.token)
        self._started = threading.Event()
        self._problem: Exception | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop: asyncio.Event | None = None
        self._thread = threading.Thread(target=self._run, name="nep-web", daemon=True)

    @property
    def url(self) -> str:
        """Where pages of this computer connect, without the token."""
        return f"ws://{_LOOPBACK}:{self.port}"

    @property
    def page_names(self) -> tuple[str, ...]:
        """Names of the nodes of connected pages."""
        return tuple(sorted(each.name for each in tuple(self._pages)))

    @property
    def pages(self) -> tuple[ConnectedPage, ...]:
        """Connected pages and programs, the first that came first. Thread-safe."""
        return tuple(each.snapshot for each in sorted(self._pages.copy(), key=lambda page: page.id))

    @property
    def refusals(self) -> tuple[Refusal, ...]:
        """The newest connections that were refused, the last one last. Thread-safe."""
        return tuple(self._refusals)

    def disconnect(self, page_id: int) -> None:
        """Close the connection of a page; it may connect again. Thread-safe, returns at once."""
        page = next((each for each in tuple(self._pages) if each.id == page_id), None)
        if page is not None and self._loop is not None:
            with suppress(RuntimeError):  # it has ended
                asyncio.run_coroutine_threadsafe(page.close(), self._loop)

    def start(self) -> Self:
        """Listen; return once pages can connect."""
        check_installed()
        if self.settings.is_open and not self.settings.access.token:
            raise NepError(_("a web server that other computers can reach needs a token"))
        for host in self.settings.listen:
            check_own_address(host)
        self._thread.start()
        self._started.wait()
        if self._problem is not None:
            self._thread.join(_JOIN_S)
            raise self._problem
        return self

    @property
    def problem(self) -> Exception | None:
        """Why it ended by itself, None when it did not."""
        return self._problem

    def wait(self, timeout_s: float) -> bool:
        """Wait until it has ended, `timeout_s` at most; whether it has."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def close(self) -> None:
        """Close all pages with the code of a server that goes away, and end. May be called twice."""
        loop, stop = self._loop, self._stop
        if loop is not None and stop is not None:
            with suppress(RuntimeError):  # it has ended
                loop.call_soon_threadsafe(stop.set)
        if self._thread.is_alive():
            self._thread.join(_JOIN_S)

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(self, *_exc: object) -> None:
        self.close()

    # ---- in its thread

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except Exception as error:
            if self._started.is_set():
                _logger.exception("the web server ended because of an error")
            self._problem = error
        finally:
            self._started.set()

    async def _serve(self) -> None:
        from websockets.asyncio.server import serve  # noqa: PLC0415 - only this command needs it

        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        with Node(
            _NODE_NAME, self.settings.transport, master=self.settings.master, wait_s=_WAIT_FOR_MASTER_S
        ) as node:
            self._guard = MotionGuard(node, self.settings.allow_moving)
            try:
                server = await serve(
                    self._page,
                    self.settings.hosts,  # type: ignore[arg-type] # asyncio takes several
                    self.settings.port,
                    process_request=self._refusal,
                    select_subprotocol=self._subprotocol,
                    compression=None,
                    open_timeout=_OPEN_TIMEOUT_S,
                    close_timeout=_CLOSE_TIMEOUT_S,
                    max_size=MAX_MESSAGE_BYTES,
                    max_queue=2,
                    server_header=None,
                    logger=_quiet_logger(),
                )
            except OSError as error:
                raise self._bind_error(error) from error
            async with server:
                self.port = next(iter(server.sockets)).getsockname()[1]
                self._started.set()
                watch = asyncio.create_task(self._watch_robots())
                await self._stop.wait()
                watch.cancel()
                server.close()  # with 1001, going away
            self._guard.close()

    def _bind_error(self, error: OSError) -> Exception:
        address = f"{', '.join(self.settings.hosts)}:{self.settings.port}"
        if error.errno == errno.EADDRINUSE:
            return AddressInUseError(address)
        if error.errno is not None and is_lack(error.errno):
            return TooManyFilesError("a web server", opened(), limit())
        if isinstance(error, PermissionError):
            return NepError(
                _("the port {port} needs rights that you don't have; choose one above 1023").format(
                    port=self.settings.port
                )
            )
        return NepError(
            _("can't listen at '{address}': {reason}").format(
                address=address, reason=error.strerror or str(error)
            )
        )

    async def _watch_robots(self) -> None:
        """Ask who is there while a page could publish: a robot may come after it advertised a topic."""
        loop = asyncio.get_running_loop()
        stop = self._stop
        with ThreadPoolExecutor(1, "nep-web-robots") as thread:
            while stop is not None and not stop.is_set():
                if self._pages:
                    await loop.run_in_executor(thread, self._guard.look)
                with suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(stop.wait(), _REFRESH_S)

    # ---- who connects

    def _refusal(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer a handshake that is refused; None lets it go on."""
        said, is_foreign = "", False
        status = HTTPStatus.FORBIDDEN
        origins = request.headers.get_all("Origin")
        access = self.settings.access
        if len(origins) > 1:
            said = _("a connection has one Origin")
        elif len(self._pages) + self._locked >= MAX_PAGES:
            status, said = HTTPStatus.SERVICE_UNAVAILABLE, _("there are too many connections")
        else:
            said = access.origin_refusal(origins[0] if origins else None)
            is_foreign = bool(said)
        if not said and access.token:
            authorizations = request.headers.get_all("Authorization")
            is_given = access.is_given(request.path, authorizations[0] if authorizations else None)
            if is_given is False:
                status, said = HTTPStatus.UNAUTHORIZED, _("the token is wrong")
            elif is_given is None and self._locked >= _MAX_LOCKED:
                status, said = HTTPStatus.UNAUTHORIZED, _("give the token, as in ws://HOST:PORT/?token=TOKEN")
            connection.is_unlocked = is_given is True  # type: ignore[attr-defined]
        if not said:
            return None
        self._turn_away(connection, said, origins[0] if origins and is_foreign else "")
        return connection.respond(status, said + "\n")

    def _subprotocol(
        self, _connection: ServerConnection, offered: Sequence[Subprotocol]
    ) -> Subprotocol | None:
        """Choose Foxglove's protocol where a client offers it; rosbridge has none."""
        if self.settings.foxglove is None:
            return None
        return next((each for each in offered if each in SUBPROTOCOLS), None)

    def _turn_away(self, connection: ServerConnection, said: str, origin: str = "") -> None:
        who = origin or _address_of(connection).rpartition(":")[0]
        self._refusals.append(Refusal(time.time(), escaped(who[:200]), said, origin[:200]))
        self.counts.turned_away += 1
        if is_logged(self.counts.turned_away):
            where = _address_of(connection)
            _logger.warning("refused %s: %s (%d so far)", where, said, self.counts.turned_away)

    async def _page(self, connection: ServerConnection) -> None:
        page: Page | FoxglovePage | None = None
        try:
            if not getattr(connection, "is_unlocked", True) and not await self._is_authenticated(connection):
                return
            name = node_name(_origin_of(connection), _address_of(connection))
            channels = self.settings.foxglove
            if channels is not None and connection.subprotocol in SUBPROTOCOLS:
                page = FoxglovePage(connection, name, self._new_node, channels, self.counts)
            else:
                page = Page(connection, name, self._new_node, self._guard, self.counts)
            self._pages.add(page)
            self.counts.opened += 1
            await page.run()
        except NepError as error:  # no more files for a node
            self._turn_away(connection, str(error))
            await connection.close(1013, "try again later")
        finally:
            if page is not None:
                self._pages.discard(page)

    async def _is_authenticated(self, connection: ServerConnection) -> bool:
        self._locked += 1
        try:
            if await authenticate(connection, self._auth):
                return True
        finally:
            self._locked -= 1
        said = _("give the token, as in ws://HOST:PORT/?token=TOKEN")
        self._turn_away(connection, said)
        await connection.close(_POLICY_VIOLATION, "the token is missing or wrong")
        return False

    def _new_node(self, name: str) -> Node:
        settings = self.settings
        return Node(name, settings.transport, master=settings.master, wait_s=_WAIT_FOR_MASTER_S)


def check_installed() -> None:
    """Raise `NepError` where the libraries of the extra ``web`` are not installed."""
    try:
        import cbor2  # noqa: F401, PLC0415 - whether it is there
        import websockets  # noqa: F401, PLC0415 - whether it is there
    except ImportError as error:
        raise NepError(
            _("the web server is not installed; install it with: pip install 'nep-studio[web]'")
        ) from error


def check_own_address(host: str) -> None:
    """Raise `NepError` for an address that this computer doesn't have.

    asyncio of Python 3.13 leaves out such an address without an error while another one can be bound.
    """
    try:
        with socket.socket() as probe:
            probe.bind((host, 0))
    except OSError as error:
        raise NepError(str(AddressInUseError(host, is_own=False))) from error


def node_name(origin: str | None, address: str) -> str:
    """Return the name of a page's node: its origin and port, or the address of a program."""
    host = urlsplit(origin).netloc if origin else ""
    port = address.rpartition(":")[2]
    return escaped(f"web_{host}_{port}" if host else f"web_{address}")[:150]


def _origin_of(connection: ServerConnection) -> str | None:
    request = connection.request
    return None if request is None else request.headers.get("Origin")


def _address_of(connection: ServerConnection) -> str:
    address = connection.remote_address
    return f"{address[0]}:{address[1]}" if isinstance(address, tuple) else str(address)


def _quiet_logger() -> logging.Logger:
    """The library logs each broken handshake with its stack; scanners of ports would fill the log."""
    logger = logging.getLogger("nep.programs.web.connections")
    logger.setLevel(logging.CRITICAL)
    return logger
