"""Web server of Studio (`nep web`): off at each start, switched on and configured in its sheet."""

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
END_WAIT_S = 12.0
LOOPBACK = "127.0.0.1"
_PORTS_TRIED = 20
MAX_PORT = 65535
WebState = Literal["off", "starting", "on"]
WebProtocol = Literal["rosbridge", "foxglove"]


class RunningServer(Protocol):
    """Interface of `nep.programs.web.WebServer` that Studio uses."""

    port: int

    @property
    def pages(self) -> tuple[context.ConnectedPage, ...]:
        """Connected pages."""

    @property
    def refusals(self) -> tuple[context.Refusal, ...]:
        """Refused connections, the newest last."""

    def set_access(self, access: access.Access) -> int:
        """Replace the allowed origins and the token; return the number of pages that this disconnects."""

    def set_allow_moving(self, names: Collection[str]) -> None:
        """Replace the names of robots that pages may move."""

    def set_foxglove(self, channels: channels.LiveChannels | None) -> int:
        """Accept clients of Foxglove's protocol, or with None disconnect them and accept no more."""

    def set_rosbridge(self, on: bool) -> int:
        """Accept clients of rosbridge, or disconnect them and accept no more."""

    def keep_out(self, page_id: int) -> None:
        """Disconnect a page and refuse it when it connects again."""

    def let_in(self, page_id: int) -> None:
        """Let a page connect again that was kept out."""

    def wait(self, timeout_s: float) -> bool:
        """Wait for the server's end; return False after ``timeout_s`` seconds."""

    def close(self) -> None:
        """Disconnect all pages and end the server."""


StartServer = Callable[["server.WebSettings"], RunningServer]
"""Starts a server; may block, is called in a background thread, and raises `NepError`."""


@dataclass(frozen=True, slots=True)
class WebServerStarted:
    """Result of a start: a server, or the sentence that explains why it failed."""

    number: int
    server: RunningServer | None
    sentence: str = ""
    free_port: int = 0
    """Port to use instead of one that is taken; 0 when the start failed for another reason."""


def start_server(settings: server.WebSettings) -> RunningServer:
    """Start a `WebServer`; the default of `StartServer`."""
    return server.WebServer(settings).start()


class WebPages:
    """The web server and its settings. Not thread-safe: use it from the window's thread.

    `host` is the address of this computer that other computers connect to, or "". `origins` are allowed
    origins of pages from other computers. `robots` are the names of robots that pages may move. `protocols`
    are those that are switched on; all share one port, the origins and the token. `kept_out` are pages that
    were disconnected here, by their ids; they are refused when they connect again. A running server follows
    changes at once; only another `host` or `port` restarts it. Settings are not saved.
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
        """Create it switched off. ``master`` is the address of the master."""
        self.master, self._post_event, self._start = master, post_event, start
        self.addresses, self._clock = addresses, clock
        self._server: RunningServer | None = None
        self._last_started: RunningServer | None = None
        self._thread: threading.Thread | None = None
        self._number = 0
        self._list = PageList()
        self.port, self.host, self.token = DEFAULT_PORT, "", ""
        self.origins: tuple[str, ...] = ()
        self.robots: tuple[str, ...] = ()
        self.protocols: frozenset[WebProtocol] = frozenset()
        self.kept_out: dict[int, context.ConnectedPage] = {}
        self.state: WebState = "off"
        self.sentence, self.free_port = "", 0
        self._failed: frozenset[WebProtocol] = frozenset()

    # ---- what is known

    @property
    def host_and_port(self) -> str:
        """Address and port that pages connect to."""
        port = self.port if self._server is None else self._server.port
        return f"{self.host or LOOPBACK}:{port}"

    @property
    def url(self) -> str:
        """WebSocket address of the server, without the token."""
        return f"ws://{self.host_and_port}"

    @property
    def full_url(self) -> str:
        """WebSocket address of the server, with the token if it requires one."""
        return f"{self.url}/?token={self.token}" if self.token else self.url

    @property
    def page_url(self) -> str:
        """Address of the test page that the server serves, with the token if it requires one."""
        return f"http{self.full_url.removeprefix('ws')}" if self.token else f"http://{self.host_and_port}/"

    @property
    def local_page_url(self) -> str:
        """The same for a browser of this computer, whose pages need not be allowed by origin."""
        return self.page_url.replace(f"//{self.host}:", f"//{LOOPBACK}:") if self.host else self.page_url

    @property
    def pages(self) -> tuple[context.ConnectedPage, ...]:
        """Pages that are connected now."""
        return () if self._server is None else self._server.pages

    @property
    def connected(self) -> tuple[context.ConnectedPage, ...]:
        """Pages that were connected at the last `refresh`."""
        return self._list.connected

    @property
    def revision(self) -> int:
        """Number of changes of `connected`."""
        return self._list.revision

    @property
    def listed(self) -> tuple[ListedPage, ...]:
        """The same, with pages that left a short time ago."""
        return self._list.listed

    @property
    def slow(self) -> tuple[SlowTopic, ...]:
        """Topics that pages read too slowly."""
        return tuple(self._list.slow())

    @property
    def bytes_per_s(self) -> float:
        """Bandwidth of all connected pages."""
        return self._list.bytes_per_s

    @property
    def refusals(self) -> tuple[context.Refusal, ...]:
        """Refused connections and commands, the newest last."""
        return () if self._server is None else self._server.refusals

    @property
    def is_port_taken(self) -> bool:
        """Whether the last start failed because another program listens on the port."""
        return self.free_port > 0

    # ---- switches

    def serve(self, protocol: WebProtocol, *, on: bool) -> None:
        """Switch a protocol on or off; the server starts in the background, and runs while one is on."""
        self.protocols = self.protocols | {protocol} if on else self.protocols - {protocol}
        if not self.protocols:
            self.switch_off()
        elif self.state == "off":
            self._begin()
        else:
            self._push()

    def switch_off(self) -> None:
        """Disconnect all pages and end the server in the background."""
        self._number += 1
        self.state, self.sentence, self.free_port = "off", "", 0
        self.protocols = frozenset()
        self.kept_out.clear()
        self._list.clear(self._clock())
        ended, self._server = self._server, None
        self._in_thread(lambda: ended.close() if ended is not None else None)

    def use_free_port(self) -> None:
        """Try again, on a port that is free, what failed because the port was taken."""
        if self.free_port:
            self.port, self.protocols = self.free_port, self._failed
            self._begin()

    # ---- settings

    def open_to(self, host: str) -> None:
        """Let other computers connect to an address of this computer, or none with "".

        A running server restarts, which disconnects all pages.
        """
        if host == self.host:
            return
        self.host = host
        self.token = (self.token or access.new_token()) if host else ""
        if self.state != "off":
            protocols = self.protocols
            self.switch_off()
            self.protocols = protocols
            self._begin()

    def new_token(self) -> int:
        """Replace the token; return the number of pages that this disconnects."""
        return self.set_token(access.new_token())

    def set_token(self, token: str) -> int:
        """Require another token; return the number of pages that this disconnects."""
        self.token = token
        return self._push()

    def add_origin(self, text: str) -> None:
        """Allow an origin. Raises `NepError` for a malformed one."""
        self.set_origins((*self.origins, access.checked_origin(text)))

    def set_origins(self, origins: Sequence[str]) -> None:
        """Allow exactly these well-formed origins, without duplicates."""
        self.origins = tuple(dict.fromkeys(origins))
        self._push()

    def set_robots(self, names: Sequence[str]) -> None:
        """Set `robots`, without duplicates."""
        self.robots = tuple(dict.fromkeys(names))
        self._push()

    def keep_out(self, page: context.ConnectedPage) -> None:
        """Disconnect a page, and refuse it until `let_in` or the end of the server."""
        if self._server is not None:
            self._server.keep_out(page.id)
            self.kept_out[page.id] = page

    def let_in(self, page_id: int) -> None:
        """Let a page connect again that was kept out."""
        self.kept_out.pop(page_id, None)
        if self._server is not None:
            self._server.let_in(page_id)

    def starter_page(self) -> str:
        """Return the HTML of a page to start from, which connects to this server."""
        return served_pages.starter_page(self.full_url)

    def _push(self) -> int:
        if self._server is None:
            return 0
        wanted = channels.LiveChannels() if "foxglove" in self.protocols else None
        self._server.set_allow_moving(self.robots)
        self._server.set_foxglove(wanted)
        self._server.set_rosbridge("rosbridge" in self.protocols)
        return self._server.set_access(access.Access(frozenset(self.origins), self.token))

    # ---- following the server

    def started(self, event: WebServerStarted) -> None:
        """Apply the result of a start; closes the server if the switch was changed meanwhile."""
        if event.number != self._number:
            if event.server is not None:
                self._in_thread(event.server.close)
            return
        self._server, self.sentence, self.free_port = event.server, event.sentence, event.free_port
        if event.server is None:
            self.state, self._failed, self.protocols = "off", self.protocols, frozenset()
        else:
            self.state = "on"
            self._push()  # what was changed during the start

    def refresh(self) -> None:
        """Take a snapshot of the connected pages."""
        self._list.update(self.pages, self._clock())

    def check(self) -> None:
        """Detect a server that ended by itself, and take a snapshot. Called once a second."""
        if self._server is not None and self._server.wait(0):
            self._server, self.state, self.protocols = None, "off", frozenset()
            self.kept_out.clear()
            self.sentence = _("The web server ended because of an error. The log has the details.")
        self.refresh()

    def close(self) -> None:
        """End the server and its threads; waits at most `END_WAIT_S` seconds."""
        self.switch_off()
        if self._thread is not None:
            self._thread.join(END_WAIT_S)
        if self._last_started is not None:  # its event may not have been applied
            self._last_started.close()

    def _begin(self) -> None:
        self._number += 1
        number = self._number
        self.state, self.sentence, self.free_port = "starting", "", 0
        port, listen, robots = self.port, (self.host,) if self.host else (), frozenset(self.robots)
        origins, token, protocols = frozenset(self.origins), self.token, self.protocols

        def work() -> None:
            settings = server.WebSettings(  # in the thread: its modules take a while to load
                port=port,
                listen=listen,
                access=access.Access(origins, token),
                allow_moving=robots,
                master=self.master,
                foxglove=channels.LiveChannels() if "foxglove" in protocols else None,
                rosbridge="rosbridge" in protocols,
            )
            try:
                running = self._start(settings)
            except AddressInUseError:
                sentence, free_port = _port_taken(port)
                self._post_event(WebServerStarted(number, None, sentence, free_port))
            except NepError as error:
                said = str(error)
                self._post_event(WebServerStarted(number, None, f"{said[:1].upper()}{said[1:]}."))
            else:
                if number != self._number:  # switched off meanwhile
                    running.close()
                    return
                self._last_started = running
                self._post_event(WebServerStarted(number, running))

        self._in_thread(work)

    def _in_thread(self, work: Callable[[], None]) -> None:
        # Runs one job after the other: a server ends before the next one binds its port.
        before = self._thread

        def run() -> None:
            if before is not None:
                before.join()
            work()

        self._thread = threading.Thread(target=run, name="studio-web", daemon=True)
        self._thread.start()


def _port_taken(port: int) -> tuple[str, int]:
    """Return the sentence that says which program has the port, and the next free port."""
    holder = processes.describe(processes.listening().get(port))
    if holder is None:
        sentence = _("Port {port} is in use by another program, perhaps rosbridge.").format(port=port)
    else:
        sentence = _("Port {port} is in use by {program} (process {pid}).").format(
            port=port, program=holder.name, pid=holder.pid
        )
    others = range(port + 1, min(port + 1 + _PORTS_TRIED, MAX_PORT + 1))
    return sentence, next((each for each in others if processes.is_free(each)), 0)
