"""`WebServer`: serves web pages and programs in a background thread with an event loop."""

from __future__ import annotations

import asyncio
import errno
import logging
import socket
import threading
import time
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from http import HTTPStatus
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import urlsplit
from weakref import WeakSet

from nep.errors import AddressInUseError, NepError, TooManyFilesError
from nep.i18n import _
from nep.nodes.node import Node
from nep.programs.robots.guard import MotionGuard
from nep.programs.web.access import Access, AuthVerifier, is_local_host, path_with_token
from nep.programs.web.blocked_pages import BlockedPages
from nep.programs.web.context import ConnectedPage, Rejection, RejectionKind, WebCounts
from nep.programs.web.foxglove import SUBPROTOCOLS, ChannelFormat, FoxglovePage, is_offered
from nep.programs.web.handshake import address_of, host_of, is_handshake, origin_of, server_origin
from nep.programs.web.limits import MAX_MESSAGE_BYTES, MAX_PAGES
from nep.programs.web.rosbridge.page import RosbridgePage, authenticate
from nep.programs.web.served_pages import PageRequest, respond
from nep.system.addresses import ANY_HOST
from nep.system.descriptors import descriptor_limit, is_descriptor_shortage, open_descriptor_count
from nep.system.log_rarely import is_logged
from nep.text import escaped

if TYPE_CHECKING:
    from typing_extensions import Self
    from websockets.asyncio.server import Server, ServerConnection
    from websockets.http11 import Request, Response
    from websockets.typing import Subprotocol


DEFAULT_PORT = 9090
"""Default TCP port, as in rosbridge."""
_logger = logging.getLogger("nep.programs.web")
_LOOPBACK = "127.0.0.1"
_NODE_NAME = "nep_web"
_REFRESH_S = 1.0
"""Interval in seconds at which the motion guard checks for new robots while pages are connected."""
_MASTER_TIMEOUT_S = 2.0
_OPEN_TIMEOUT_S = 5.0
_CLOSE_TIMEOUT_S = 2.0
_SHUTDOWN_TIMEOUT_S = 1.0
"""Time in seconds that pages have to reply to a close frame when the server stops."""
_JOIN_TIMEOUT_S = 10.0
_POLICY_VIOLATION = 1008
_MAX_REJECTIONS = 50
LANGUAGE = "web"
"""Language of the pages' nodes in the graph, by which other programs recognize pages."""
_MAX_UNAUTHENTICATED = 16
"""Maximum number of connections without a token that wait for an ``auth`` operation."""


@dataclass(frozen=True)
class WebSettings:
    """Settings of a `WebServer`.

    Attributes:
        port: TCP port; 0 for any free port.
        listen: Further addresses of this computer at which other computers can connect. They require a
            token.
        access: Rules that decide which pages may connect.
        allow_moving: Names of the robots that pages may move.
        master: Address of the master; None for the default.
        transport: Name of the back end.
    """

    port: int = DEFAULT_PORT
    listen: Collection[str] = ()
    access: Access = field(default_factory=Access)
    allow_moving: Collection[str] = ()
    master: str | None = None
    transport: str = "zeromq"
    foxglove: ChannelFormat | None = None
    """Encoder for clients of Foxglove's WebSocket protocol; None rejects these clients."""
    is_rosbridge_enabled: bool = True
    """True to accept rosbridge clients, which are all clients without Foxglove's subprotocol."""

    @property
    def hosts(self) -> tuple[str, ...]:
        """All addresses at which the server listens."""
        if ANY_HOST in self.listen:
            return (ANY_HOST,)
        return tuple(dict.fromkeys((_LOOPBACK, *self.listen)))

    @property
    def is_open(self) -> bool:
        """True if other computers can connect."""
        return any(not is_local_host(each) for each in self.hosts)


class _HandshakeRejection(NamedTuple):
    status: HTTPStatus
    kind: RejectionKind
    message: str


class WebServer:
    """WebSocket server that runs from `start` until `close`. Usable as a context manager.

    Each page has a node with the ``language`` "web" in the graph (`NodeInfo.language`) and the name
    `ConnectedPage.name`. The server's own node is "nep_web" with the language "Python".
    """

    def __init__(self, settings: WebSettings) -> None:
        self.settings = settings
        self.counts = WebCounts()
        self.port = settings.port
        self._pages: dict[RosbridgePage | FoxglovePage, Access] = {}
        """Connected pages, each with the access rules by which it was accepted."""
        self._lock = threading.Lock()
        """Lock for changes of `settings` while pages connect."""
        self._guard: MotionGuard | None = None
        self._connections: WeakSet[ServerConnection] = WeakSet()
        """All open connections, including those without a handshake."""
        self._unauthenticated_count = 0
        self._blocked_pages = BlockedPages()
        self._rejections_lock = threading.Lock()
        self._rejections: tuple[Rejection, ...] = ()
        self._auth_verifier = AuthVerifier(settings.access.token)
        self._started = threading.Event()
        self._problem: Exception | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop: asyncio.Event | None = None
        self._thread = threading.Thread(target=self._run, name="nep-web", daemon=True)

    @property
    def url(self) -> str:
        """WebSocket URL for pages on this computer, without the token."""
        return f"ws://{_LOOPBACK}:{self.port}"

    @property
    def test_page_url(self) -> str:
        """URL of the test page for a browser on this computer, with the token if one is required."""
        return f"http://{_LOOPBACK}:{self.port}{path_with_token(self.settings.access.token)}"

    @property
    def page_names(self) -> tuple[str, ...]:
        """Names of the nodes of connected pages."""
        return tuple(sorted(each.name for each in self._pages.copy()))

    @property
    def pages(self) -> tuple[ConnectedPage, ...]:
        """Connected pages and programs, in the order in which they connected. Thread-safe."""
        pages = sorted(self._pages.copy(), key=lambda page: page.id)
        return tuple(each.snapshot for each in pages if not each.is_closing)

    @property
    def rejections(self) -> tuple[Rejection, ...]:
        """Latest rejected connections and messages, oldest first. Thread-safe.

        A repeated rejection, such as of a page that reconnects, is listed once with the time of the last
        one.
        """
        return self._rejections

    def disconnect(self, page_id: int) -> None:
        """Close the connection of a page without waiting. The page may connect again. Thread-safe."""
        self._disconnect(lambda page, _access: page.id == page_id, "disconnected by the user of the server")

    def block_page(self, page_id: int) -> None:
        """Disconnect and block a page until `unblock_page` is called. Thread-safe.

        A page is identified by its address, origin and User-Agent. Other connected pages with the same
        identity stay connected.
        """
        page = next((each for each in self._pages.copy() if each.id == page_id), None)
        if page is not None:
            self._blocked_pages.add(page_id, page.connection)
            self.disconnect(page_id)

    def unblock_page(self, page_id: int) -> None:
        """Unblock a page that `block_page` has blocked. Thread-safe."""
        self._blocked_pages.remove(page_id)

    def set_access(self, access: Access) -> int:
        """Replace the access rules; return the number of pages that are disconnected. Thread-safe.

        A page is disconnected if its origin is no longer allowed, or if it connected without the new token.
        Raises `NepError` for rules without a token if other computers can connect.
        """
        check_token(replace(self.settings, access=access))
        with self._lock:
            if access.token != self.settings.access.token:
                self._auth_verifier = AuthVerifier(access.token)
            self.settings = replace(self.settings, access=access)
            return self._disconnect(
                lambda page, previous_access: not self._is_still_allowed(page.connection, previous_access),
                "this page is no longer allowed to connect",
            )

    def set_allow_moving(self, names: Collection[str]) -> None:
        """Replace the names of the robots that pages may move. Thread-safe.

        The names also apply to connected pages.
        """
        with self._lock:
            self.settings = replace(self.settings, allow_moving=frozenset(names))
            if self._guard is not None:
                self._guard.set_allowed(names)

    def set_foxglove(self, channels: ChannelFormat | None) -> int:
        """Enable or disable Foxglove's protocol; return the number of pages that are disconnected.

        Thread-safe.

        Args:
            channels: Encoder of messages, such as `nep.recordings.formats.channels.LiveChannels`; None
                disables the protocol and disconnects its clients.
        """
        with self._lock:
            self.settings = replace(self.settings, foxglove=channels)
            if channels is not None:
                return 0
            return self._disconnect(
                lambda page, _access: page.protocol == "foxglove", "Foxglove's protocol was turned off"
            )

    def set_rosbridge(self, is_enabled: bool) -> int:
        """Enable or disable rosbridge; return the number of pages that are disconnected. Thread-safe."""
        with self._lock:
            self.settings = replace(self.settings, is_rosbridge_enabled=is_enabled)
            if is_enabled:
                return 0
            return self._disconnect(
                lambda page, _access: page.protocol == "rosbridge", "rosbridge was turned off"
            )

    def _disconnect(
        self, should_disconnect: Callable[[RosbridgePage | FoxglovePage, Access], bool], reason: str
    ) -> int:
        pages = [
            page
            for page, access in self._pages.copy().items()
            if not page.is_closing and should_disconnect(page, access)
        ]
        for page in pages:
            page.is_closing = True
            if self._loop is not None:
                with suppress(RuntimeError):  # the event loop is closed
                    self._loop.call_soon_threadsafe(page.start_closing, reason)
        return len(pages)

    def start(self) -> Self:
        """Start the server and wait until pages can connect.

        Raises:
            AddressInUseError: The port is in use.
            NepError: The libraries are not installed, an address in `WebSettings.listen` isn't an
                address of this computer, or a token is required.
        """
        check_installed()
        check_token(self.settings)
        for host in self.settings.listen:
            check_own_address(host)
        self._thread.start()
        self._started.wait()
        if self._problem is not None:
            self._thread.join(_JOIN_TIMEOUT_S)
            raise self._problem
        return self

    @property
    def problem(self) -> Exception | None:
        """Error that stopped the server; None if there was none."""
        return self._problem

    def wait(self, timeout_s: float) -> bool:
        """Wait until the server has stopped; return False after `timeout_s` seconds."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def close(self) -> None:
        """Close all connections with the code "going away" and stop the server. Idempotent."""
        loop, stop = self._loop, self._stop
        if loop is not None and stop is not None:
            with suppress(RuntimeError):  # the event loop is closed
                loop.call_soon_threadsafe(stop.set)
        if self._thread.is_alive():
            self._thread.join(_JOIN_TIMEOUT_S)

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(self, *_exc: object) -> None:
        self.close()

    # ---- in the server's thread

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except Exception as error:
            if self._started.is_set():
                _logger.exception("the web server stopped because of an error")
            self._problem = error
        finally:
            self._started.set()

    async def _serve(self) -> None:
        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        with Node(
            _NODE_NAME, self.settings.transport, master=self.settings.master, wait_s=_MASTER_TIMEOUT_S
        ) as node:
            with self._lock:
                guard = self._guard = MotionGuard(node, self.settings.allow_moving)
            server = await self._listen(guard)
            async with server:
                self.port = next(iter(server.sockets)).getsockname()[1]
                self._started.set()
                watch_task = asyncio.create_task(self._watch_robots(guard))
                await self._stop.wait()
                watch_task.cancel()
                server.close()  # with 1001, going away
                with suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(server.wait_closed(), _SHUTDOWN_TIMEOUT_S)
                for connection in tuple(self._connections):  # connections that did not close in time
                    if hasattr(connection, "transport"):  # connected
                        connection.transport.abort()
            guard.close()

    async def _listen(self, guard: MotionGuard) -> Server:
        from websockets.asyncio.server import ServerConnection, serve  # noqa: PLC0415 - only needed here

        def new_connection(*args: Any, **options: Any) -> ServerConnection:  # noqa: ANN401 - the library's own
            connection = ServerConnection(*args, **options)
            self._connections.add(connection)
            return connection

        try:
            return await serve(
                partial(self._serve_page, guard),
                self.settings.hosts,  # type: ignore[arg-type] # asyncio accepts a sequence
                self.settings.port,
                process_request=self._process_request,
                select_subprotocol=self._select_subprotocol,
                compression=None,
                open_timeout=_OPEN_TIMEOUT_S,
                close_timeout=_CLOSE_TIMEOUT_S,
                max_size=MAX_MESSAGE_BYTES,
                max_queue=2,
                server_header=None,
                logger=_quiet_logger(),
                create_connection=new_connection,  # type: ignore[arg-type] # functions are accepted, too
            )
        except OSError as error:
            raise self._bind_error(error) from error

    def _bind_error(self, error: OSError) -> Exception:
        address = f"{', '.join(self.settings.hosts)}:{self.settings.port}"
        if error.errno == errno.EADDRINUSE:
            return AddressInUseError(address)
        if error.errno is not None and is_descriptor_shortage(error.errno):
            return TooManyFilesError(_("a web server"), open_descriptor_count(), descriptor_limit())
        if isinstance(error, PermissionError):
            return NepError(
                _("port {port} needs administrator rights; choose a port above 1023").format(
                    port=self.settings.port
                )
            )
        return NepError(
            _("can't listen at '{address}': {reason}").format(
                address=address, reason=error.strerror or str(error)
            )
        )

    async def _watch_robots(self, guard: MotionGuard) -> None:
        """Poll the graph while pages are connected.

        A robot may appear after a page has advertised its topic.
        """
        loop = asyncio.get_running_loop()
        stop = self._stop
        with ThreadPoolExecutor(1, "nep-web-robots") as thread:
            while stop is not None and not stop.is_set():
                if self._pages:
                    await loop.run_in_executor(thread, guard.poll)
                with suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(stop.wait(), _REFRESH_S)

    # ---- accepting connections

    def _process_request(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return the response to a rejected handshake or to an HTTP request; None accepts a handshake."""
        if not is_handshake(request):
            return self._page_response(connection, request)
        access = self.settings.access
        origins = request.headers.get_all("Origin")
        origin = origins[0] if origins else None
        rejection: _HandshakeRejection | None
        if len(origins) > 1:
            rejection = _HandshakeRejection(
                HTTPStatus.FORBIDDEN, "other", _("the request has more than one Origin header")
            )
        elif len(self._pages) + self._unauthenticated_count >= MAX_PAGES:
            rejection = _HandshakeRejection(
                HTTPStatus.SERVICE_UNAVAILABLE, "limit", _("too many connections")
            )
        elif reason := access.origin_rejection_reason(origin, server_origin(connection)):
            rejection = _HandshakeRejection(HTTPStatus.FORBIDDEN, "origin", reason)
        elif self._blocked_pages.is_blocked(connection, request):
            rejection = _HandshakeRejection(
                HTTPStatus.FORBIDDEN, "kept out", _("the user disconnected this page")
            )
        elif not (
            self.settings.is_rosbridge_enabled
            or is_offered(request.headers.get_all("Sec-WebSocket-Protocol"))
        ):
            rejection = _HandshakeRejection(HTTPStatus.FORBIDDEN, "other", _("rosbridge is turned off"))
        else:
            rejection = self._token_rejection(connection, request, access)
        if rejection is None:
            return None
        self._record_rejection(
            connection,
            rejection.kind,
            rejection.message,
            (origin or "") if rejection.kind == "origin" else "",
        )
        return connection.respond(rejection.status, rejection.message + "\n")

    def _page_response(self, connection: ServerConnection, request: Request) -> Response:
        """Return the response to an HTTP request for one of the server's own pages."""
        from websockets.datastructures import Headers  # noqa: PLC0415 - only this command needs it
        from websockets.http11 import Response  # noqa: PLC0415 - only this command needs it

        authorizations = request.headers.get_all("Authorization")
        method = getattr(request, "method", "GET")  # websockets before 17 rejects other methods itself
        page_request = PageRequest(
            method,
            request.path,
            tuple(request.headers.get_all("Host")),
            server_origin(connection),
            authorizations[0] if len(authorizations) == 1 else None,
        )
        page_response = respond(page_request, self.settings.access)
        if page_response.is_token_rejected:
            self._record_rejection(
                connection, "token", _("a page connected without the token or with a wrong one")
            )
        headers = Headers(page_response.headers)
        headers["Connection"] = "close"
        headers["Content-Length"] = str(len(page_response.body))
        body = b"" if method == "HEAD" else page_response.body
        return Response(page_response.status.value, page_response.status.phrase, headers, body)

    def _token_rejection(
        self, connection: ServerConnection, request: Request, access: Access
    ) -> _HandshakeRejection | None:
        authorizations = request.headers.get_all("Authorization")
        is_token_valid = access.check_token(request.path, authorizations[0] if authorizations else None)
        connection.is_unlocked = not access.token or is_token_valid is True  # type: ignore[attr-defined]
        connection.access = access  # type: ignore[attr-defined]
        if not access.token or is_token_valid:
            return None
        if is_token_valid is False:
            return _HandshakeRejection(HTTPStatus.UNAUTHORIZED, "token", _("the token is wrong"))
        if self._unauthenticated_count >= _MAX_UNAUTHENTICATED:
            return _HandshakeRejection(
                HTTPStatus.UNAUTHORIZED,
                "token",
                _("a token is required; connect to ws://HOST:PORT/?token=TOKEN"),
            )
        return None

    def _select_subprotocol(
        self, _connection: ServerConnection, offered: Sequence[Subprotocol]
    ) -> Subprotocol | None:
        """Return Foxglove's subprotocol if it is enabled and the client offers it, else None.

        rosbridge has no subprotocol.
        """
        if self.settings.foxglove is None:
            return None
        return next((each for each in offered if each in SUBPROTOCOLS), None)

    def _record_rejection(
        self, connection: ServerConnection, kind: RejectionKind, message: str, origin: str = ""
    ) -> None:
        source = escaped((origin or host_of(connection))[:200])
        self._add_rejection(Rejection(time.time(), source, message, origin[:200], kind))
        self.counts.turned_away += 1
        if is_logged(self.counts.turned_away):
            address = address_of(connection)
            _logger.warning("rejected %s: %s (%d so far)", address, message, self.counts.turned_away)

    def _record_robot_rejection(self, connection: ServerConnection, robot: str, message: str) -> None:
        source = escaped((origin_of(connection) or host_of(connection))[:200])
        self._add_rejection(Rejection(time.time(), source, message, kind="robot", robot=escaped(robot[:200])))

    def _add_rejection(self, rejection: Rejection) -> None:
        with self._rejections_lock:
            others = (
                each for each in self._rejections if replace(each, time_s=rejection.time_s) != rejection
            )
            self._rejections = (*others, rejection)[-_MAX_REJECTIONS:]

    async def _serve_page(self, guard: MotionGuard, connection: ServerConnection) -> None:
        access: Access = connection.access  # type: ignore[attr-defined]
        page: RosbridgePage | FoxglovePage | None = None
        try:
            if not connection.is_unlocked:  # type: ignore[attr-defined]
                with self._lock:
                    access, verifier = self.settings.access, self._auth_verifier
                if access.token and not await self._authenticate(connection, verifier):
                    return
            with self._lock:
                if self._is_still_allowed(connection, access):
                    page = self._new_page(connection, guard)
                    self._pages[page] = access
            if page is None:
                await connection.close(_POLICY_VIOLATION, "this page is no longer allowed to connect")
                return
            self.counts.opened += 1
            await page.run()
        except NepError as error:  # no file descriptor left for a node
            self._record_rejection(connection, "limit", str(error))
            await connection.close(1013, "try again later")
        finally:
            if page is not None:
                self._pages.pop(page, None)

    def _new_page(self, connection: ServerConnection, guard: MotionGuard) -> RosbridgePage | FoxglovePage:
        name = node_name(origin_of(connection), address_of(connection))
        channels = self.settings.foxglove
        report = partial(self._record_robot_rejection, connection)
        if channels is not None and connection.subprotocol in SUBPROTOCOLS:
            return FoxglovePage(
                connection,
                name,
                self._new_node,
                self.counts,
                channels=channels,
                guard=guard,
                on_robot_rejected=report,
            )
        return RosbridgePage(connection, name, self._new_node, guard, self.counts, report)

    def _is_still_allowed(self, connection: ServerConnection, previous_access: Access) -> bool:
        """Return True if the current rules allow a page accepted under the rules `previous_access`."""
        access = self.settings.access
        if not self.settings.is_rosbridge_enabled and connection.subprotocol not in SUBPROTOCOLS:
            return False
        rejection_reason = access.origin_rejection_reason(origin_of(connection), server_origin(connection))
        return not rejection_reason and (not access.token or access.token == previous_access.token)

    async def _authenticate(self, connection: ServerConnection, verifier: AuthVerifier) -> bool:
        self._unauthenticated_count += 1
        try:
            if await authenticate(connection, verifier):
                return True
        finally:
            self._unauthenticated_count -= 1
        message = _("a token is required; connect to ws://HOST:PORT/?token=TOKEN")
        self._record_rejection(connection, "token", message)
        await connection.close(_POLICY_VIOLATION, "the token is missing or wrong")
        return False

    def _new_node(self, name: str) -> Node:
        settings = self.settings
        return Node(
            name, settings.transport, master=settings.master, wait_s=_MASTER_TIMEOUT_S, language=LANGUAGE
        )


def check_installed() -> None:
    """Raise `NepError` if the libraries of the extra ``web`` are not installed."""
    try:
        import cbor2  # noqa: F401, PLC0415 - installed
        import websockets.asyncio.server  # noqa: F401, PLC0415 - installed and recent enough
    except ImportError as error:
        raise NepError(
            _("the web server isn't installed; install it with: pip install 'nep-studio[web]'")
        ) from error


def check_token(settings: WebSettings) -> None:
    """Raise `NepError` if other computers can reach the server and no token is set."""
    if settings.is_open and not settings.access.token:
        raise NepError(_("a web server that other computers can reach needs a token"))


def check_own_address(host: str) -> None:
    """Raise `NepError` if `host` isn't an address of this computer.

    asyncio of Python 3.13 silently skips such an address if another one can be bound.
    """
    try:
        with socket.socket() as probe:
            probe.bind((host, 0))
    except OSError as error:
        raise NepError(str(AddressInUseError(host, is_own=False))) from error


def node_name(origin: str | None, address: str) -> str:
    """Return the node name for a page or program.

    Args:
        origin: Origin of the page; None for a program.
        address: IP address and port of the client.
    """
    host = urlsplit(origin).netloc if origin else ""
    port = address.rpartition(":")[2]
    return escaped(f"web_{host}_{port}" if host else f"web_{address}")[:150]


def _quiet_logger() -> logging.Logger:
    """Return a logger that discards the records of the websockets library.

    The library logs each failed handshake with a traceback, so that port scanners would fill the log.
    """
    logger = logging.getLogger("nep.programs.web.connections")
    logger.setLevel(logging.CRITICAL)
    return logger
