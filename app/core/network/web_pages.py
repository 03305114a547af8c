"""Web server of Studio (`nep web`). The server is off at each start until the user switches it on."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol

from app.core.network.web_page_list import ListedPage, PageList, SlowTopic
from nep.errors import AddressInUseError, NepError
from nep.i18n import _
from nep.system.addresses import OwnAddress, own_addresses
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from nep.programs.doctor import processes
    from nep.programs.web import access, context, served_pages, server
    from nep.recordings.formats import channels
else:  # loaded with the first start of a server
    processes = lazy_module("nep.programs.doctor.processes")
    access = lazy_module("nep.programs.web.access")
    context = lazy_module("nep.programs.web.context")
    server = lazy_module("nep.programs.web.server")
    served_pages = lazy_module("nep.programs.web.served_pages")
    channels = lazy_module("nep.recordings.formats.channels")

DEFAULT_PORT = 9090
STOP_TIMEOUT_S = 12.0
LOOPBACK = "127.0.0.1"
_MAX_PORTS_TRIED = 20
MAX_PORT = 65535
WebState = Literal["off", "starting", "on"]
WebProtocol = Literal["rosbridge", "foxglove"]


class RunningServer(Protocol):
    """Part of the interface of `nep.programs.web.WebServer` that Studio uses."""

    port: int

    @property
    def pages(self) -> tuple[context.ConnectedPage, ...]:
        """Connected pages."""

    @property
    def rejections(self) -> tuple[context.Rejection, ...]:
        """Rejected connections and commands, oldest first."""

    def set_access(self, access: access.Access) -> int:
        """Set the allowed origins and the token; return the number of pages that this disconnects."""

    def set_allow_moving(self, names: Collection[str]) -> None:
        """Set the names of the robots that pages may move."""

    def set_foxglove(self, channels: channels.LiveChannels | None) -> int:
        """Switch the Foxglove protocol on or off.

        Args:
            channels: Channels for Foxglove clients; None disconnects all clients and rejects new ones.

        Returns:
            Number of disconnected clients.
        """

    def set_rosbridge(self, is_enabled: bool) -> int:
        """Switch the rosbridge protocol on or off.

        Args:
            is_enabled: True to accept clients; False to disconnect all clients and reject new ones.

        Returns:
            Number of disconnected clients.
        """

    def block_page(self, page_id: int) -> None:
        """Disconnect a page and reject its further connections."""

    def unblock_page(self, page_id: int) -> None:
        """Accept connections of a page again that `block_page` blocked."""

    def wait(self, timeout_s: float) -> bool:
        """Wait until the server has stopped; return False on timeout (in seconds)."""

    def close(self) -> None:
        """Disconnect all pages and stop the server."""


StartServer = Callable[["server.WebSettings"], RunningServer]
"""Function that starts a server. Runs in a background thread, may block, and raises `NepError` on failure."""


@dataclass(frozen=True, slots=True)
class WebServerStarted:
    """Event: a start of the server has succeeded or failed.

    Attributes:
        number: Number of the start, which identifies results of outdated starts.
        server: Running server; None if the start failed.
        message: Reason for the failure, or "".
        free_port: Unused port to offer if the requested port is in use, else 0.
    """

    number: int
    server: RunningServer | None
    message: str = ""
    free_port: int = 0


def start_server(settings: server.WebSettings) -> RunningServer:
    """Start a `WebServer`; the default of `StartServer`."""
    return server.WebServer(settings).start()


class WebPages:
    """Web server of Studio and its settings. Not thread-safe; use it from the main thread.

    Changed settings are applied to a running server immediately; only a change of `host` or `port`
    restarts it. The settings are not saved.

    Attributes:
        host: Address of this computer at which other computers can connect; "" for none.
        origins: Allowed origins of pages from other computers.
        robots: Names of the robots that pages may move.
        protocols: Protocols that are switched on. All share the port, the origins and the token.
        blocked_pages: Blocked pages, by id. The user disconnected them, and their further connections are
            rejected.
    """

    def __init__(
        self,
        master: str,
        post_event: Callable[[object], None],
        *,
        start: StartServer = start_server,
        addresses: Callable[[], tuple[OwnAddress, ...]] = own_addresses,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Create the web server, switched off.

        Args:
            master: Address of the master.
            post_event: Thread-safe callback that receives `WebServerStarted` events.
            start: Starts a server.
            addresses: Returns the addresses of this computer.
            clock: Returns monotonic seconds.
        """
        self.master, self._post_event, self._start = master, post_event, start
        self.addresses, self._clock = addresses, clock
        self._server: RunningServer | None = None
        self._last_started: RunningServer | None = None
        self._thread: threading.Thread | None = None
        self._start_number = 0
        self._page_list = PageList()
        self.port, self.host, self.token = DEFAULT_PORT, "", ""
        self.origins: tuple[str, ...] = ()
        self.robots: tuple[str, ...] = ()
        self.protocols: frozenset[WebProtocol] = frozenset()
        self.blocked_pages: dict[int, context.ConnectedPage] = {}
        self.state: WebState = "off"
        self.sentence, self.free_port = "", 0
        self._failed_protocols: frozenset[WebProtocol] = frozenset()

    # ---- what is known

    @property
    def host_and_port(self) -> str:
        """Host and port to which pages connect, such as "192.168.1.20:9090"."""
        port = self.port if self._server is None else self._server.port
        return f"{self.host or LOOPBACK}:{port}"

    @property
    def url(self) -> str:
        """WebSocket address of the server, without the token."""
        return f"ws://{self.host_and_port}"

    @property
    def full_url(self) -> str:
        """WebSocket address of the server, including the token if one is required."""
        return f"{self.url}/?token={self.token}" if self.token else self.url

    @property
    def page_url(self) -> str:
        """Address of the server's test page, including the token if one is required."""
        return f"http{self.full_url.removeprefix('ws')}" if self.token else f"http://{self.host_and_port}/"

    @property
    def local_page_url(self) -> str:
        """Address of the server's test page for browsers on this computer, which need no allowed origin."""
        return self.page_url.replace(f"//{self.host}:", f"//{LOOPBACK}:") if self.host else self.page_url

    @property
    def pages(self) -> tuple[context.ConnectedPage, ...]:
        """Currently connected pages."""
        return () if self._server is None else self._server.pages

    @property
    def connected(self) -> tuple[context.ConnectedPage, ...]:
        """Pages that were connected at the last `refresh`."""
        return self._page_list.connected

    @property
    def revision(self) -> int:
        """Counter that increases when `connected` changes."""
        return self._page_list.revision

    @property
    def listed_pages(self) -> tuple[ListedPage, ...]:
        """Pages that were connected at the last `refresh`, and pages that left recently."""
        return self._page_list.listed_pages

    @property
    def slow_topics(self) -> tuple[SlowTopic, ...]:
        """Topics that pages read too slowly, so that messages are dropped."""
        return tuple(self._page_list.slow_topics())

    @property
    def bytes_per_s(self) -> float:
        """Total bandwidth of all connected pages in bytes per second."""
        return self._page_list.bytes_per_s

    @property
    def rejections(self) -> tuple[context.Rejection, ...]:
        """Rejected connections and commands, oldest first."""
        return () if self._server is None else self._server.rejections

    @property
    def is_port_taken(self) -> bool:
        """True if the last start failed because the port is in use, and another port is free.

        `use_free_port` uses the other port.
        """
        return self.free_port > 0

    # ---- switches

    def set_protocol_enabled(self, protocol: WebProtocol, *, on: bool) -> None:
        """Switch a protocol on or off.

        The first protocol that is switched on starts the server in the background; when all are off, it
        stops.
        """
        self.protocols = self.protocols | {protocol} if on else self.protocols - {protocol}
        if not self.protocols:
            self.switch_off()
        elif self.state == "off":
            self._start_server()
        else:
            self._apply_settings()

    def switch_off(self) -> None:
        """Disconnect all pages and stop the server in the background."""
        self._start_number += 1
        self.state, self.sentence, self.free_port = "off", "", 0
        self.protocols = frozenset()
        self.blocked_pages.clear()
        self._page_list.clear(self._clock())
        stopped_server, self._server = self._server, None
        self._run_in_thread(lambda: stopped_server.close() if stopped_server is not None else None)

    def use_free_port(self) -> None:
        """Start the server on an unused port with the protocols of the failed start.

        Has no effect unless `is_port_taken` is True.
        """
        if self.free_port:
            self.port, self.protocols = self.free_port, self._failed_protocols
            self._start_server()

    # ---- settings

    def listen_on(self, host: str) -> None:
        """Set the address at which other computers can connect.

        A running server restarts and disconnects all pages.

        Args:
            host: Address of this computer; "" to reject other computers.
        """
        if host == self.host:
            return
        self.host = host
        self.token = (self.token or access.new_token()) if host else ""
        if self.state != "off":
            protocols = self.protocols
            self.switch_off()
            self.protocols = protocols
            self._start_server()

    def generate_token(self) -> int:
        """Generate a new token; return the number of pages that are disconnected by the change."""
        return self.set_token(access.new_token())

    def set_token(self, token: str) -> int:
        """Set the required token ("" for none); return the number of pages that this disconnects."""
        self.token = token
        return self._apply_settings()

    def add_origin(self, text: str) -> None:
        """Allow an origin. Raises `NepError` if the origin is malformed."""
        self.set_origins((*self.origins, access.checked_origin(text)))

    def set_origins(self, origins: Sequence[str]) -> None:
        """Set the allowed origins, which must be well-formed; duplicates are removed."""
        self.origins = tuple(dict.fromkeys(origins))
        self._apply_settings()

    def set_robots(self, names: Sequence[str]) -> None:
        """Set the names of the robots that pages may move; duplicates are removed."""
        self.robots = tuple(dict.fromkeys(names))
        self._apply_settings()

    def block_page(self, page: context.ConnectedPage) -> None:
        """Disconnect a page and block further connections of the page.

        The page is blocked until `unblock_page` is called or the server stops.
        """
        if self._server is not None:
            self._server.block_page(page.id)
            self.blocked_pages[page.id] = page

    def unblock_page(self, page_id: int) -> None:
        """Unblock a page that was blocked with `block_page`."""
        self.blocked_pages.pop(page_id, None)
        if self._server is not None:
            self._server.unblock_page(page_id)

    def template_page(self) -> str:
        """Return the HTML of a minimal page that connects to this server, as a template for the user."""
        return served_pages.starter_page(self.full_url)

    def _apply_settings(self) -> int:
        if self._server is None:
            return 0
        live_channels = channels.LiveChannels() if "foxglove" in self.protocols else None
        self._server.set_allow_moving(self.robots)
        self._server.set_foxglove(live_channels)
        self._server.set_rosbridge("rosbridge" in self.protocols)
        return self._server.set_access(access.Access(frozenset(self.origins), self.token))

    # ---- following the server

    def on_started(self, event: WebServerStarted) -> None:
        """Apply the result of a start. An outdated server (switched off or restarted meanwhile) is closed."""
        if event.number != self._start_number:
            if event.server is not None:
                self._run_in_thread(event.server.close)
            return
        self._server, self.sentence, self.free_port = event.server, event.message, event.free_port
        if event.server is None:
            self.state, self._failed_protocols, self.protocols = "off", self.protocols, frozenset()
        else:
            self.state = "on"
            self._apply_settings()  # apply changes made during the start

    def refresh(self) -> None:
        """Update `connected` and `listed_pages` from the running server."""
        self._page_list.update(self.pages, self._clock())

    def check(self) -> None:
        """Detect that the server stopped unexpectedly, and call `refresh`. Called once a second."""
        if self._server is not None and self._server.wait(0):
            self._server, self.state, self.protocols = None, "off", frozenset()
            self.blocked_pages.clear()
            self.sentence = _("The web server stopped because of an error. See the log for details.")
        self.refresh()

    def close(self) -> None:
        """Stop the server and its threads. Waits at most `STOP_TIMEOUT_S` seconds."""
        self.switch_off()
        if self._thread is not None:
            self._thread.join(STOP_TIMEOUT_S)
        if self._last_started is not None:  # its event may not have been applied
            self._last_started.close()

    def _start_server(self) -> None:
        self._start_number += 1
        number = self._start_number
        self.state, self.sentence, self.free_port = "starting", "", 0
        port, listen, robots = self.port, (self.host,) if self.host else (), frozenset(self.robots)
        origins, token, protocols = frozenset(self.origins), self.token, self.protocols

        def start() -> None:
            settings = server.WebSettings(  # in the thread: its modules take a while to load
                port=port,
                listen=listen,
                access=access.Access(origins, token),
                allow_moving=robots,
                master=self.master,
                foxglove=channels.LiveChannels() if "foxglove" in protocols else None,
                is_rosbridge_enabled="rosbridge" in protocols,
            )
            try:
                running_server = self._start(settings)
            except AddressInUseError:
                message, free_port = _port_conflict(port)
                self._post_event(WebServerStarted(number, None, message, free_port))
            except NepError as error:
                error_message = str(error)
                self._post_event(
                    WebServerStarted(number, None, f"{error_message[:1].upper()}{error_message[1:]}.")
                )
            else:
                if number != self._start_number:  # switched off meanwhile
                    running_server.close()
                    return
                self._last_started = running_server
                self._post_event(WebServerStarted(number, running_server))

        self._run_in_thread(start)

    def _run_in_thread(self, job: Callable[[], None]) -> None:
        # Runs one job after the other: a server ends before the next one binds its port.
        previous_thread = self._thread

        def run() -> None:
            if previous_thread is not None:
                previous_thread.join()
            job()

        self._thread = threading.Thread(target=run, name="studio-web", daemon=True)
        self._thread.start()


def _port_conflict(port: int) -> tuple[str, int]:
    """Return an error message that names the program using the port, and the next unused port."""
    port_owner = processes.process_fact(processes.listening_ports().get(port))
    if port_owner is None:
        message = _("Port {port} is in use by another program, perhaps rosbridge.").format(port=port)
    else:
        message = _("Port {port} is in use by {program} (process {pid}).").format(
            port=port, program=port_owner.name, pid=port_owner.pid
        )
    ports = range(port + 1, min(port + 1 + _MAX_PORTS_TRIED, MAX_PORT + 1))
    return message, next((each for each in ports if processes.is_free(each)), 0)
