"""Web server of Studio (`nep web`): off at each start, switched on and configured in its sheet."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol

from nep.errors import AddressInUseError, NepError
from nep.i18n import _
from nep.system.addresses import OwnAddress, own_addresses
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from nep.programs.web import access, context, server
else:  # loaded with the first start of a server
    access = lazy_module("nep.programs.web.access")
    context = lazy_module("nep.programs.web.context")
    server = lazy_module("nep.programs.web.server")

DEFAULT_PORT = 9090
END_WAIT_S = 12.0
WebState = Literal["off", "starting", "on"]


class RunningServer(Protocol):
    """Interface of `nep.programs.web.WebServer` that Studio uses."""

    port: int

    @property
    def pages(self) -> tuple[context.ConnectedPage, ...]:
        """Connected pages."""

    @property
    def refusals(self) -> tuple[context.Refusal, ...]:
        """Refused connections, the newest last."""

    def disconnect(self, page_id: int) -> None:
        """Disconnect a page."""

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
    is_port_taken: bool = False


def start_server(settings: server.WebSettings) -> RunningServer:
    """Start a `WebServer`; the default of `StartServer`."""
    return server.WebServer(settings).start()


class WebPages:
    """The web server and its settings. Not thread-safe: use it from the window's thread.

    `host` is the address of this computer that other computers connect to, or "". `origins` are allowed
    origins of pages from other computers. `robots` are the names of robots that pages may move. New settings
    apply at the next start; `apply` restarts a running server. Settings are not saved.
    """

    def __init__(
        self,
        master: str,
        post_event: Callable[[object], None],
        *,
        start: StartServer = start_server,
        addresses: Callable[[], tuple[OwnAddress, ...]] = own_addresses,
    ) -> None:
        """Create it switched off. ``master`` is the address of the master."""
        self._master, self._post_event, self._start = master, post_event, start
        self.addresses = addresses
        self._server: RunningServer | None = None
        self._last_started: RunningServer | None = None
        self._thread: threading.Thread | None = None
        self._number = 0
        self.port, self.host, self.token = DEFAULT_PORT, "", ""
        self.origins: tuple[str, ...] = ()
        self.robots: tuple[str, ...] = ()
        self.state: WebState = "off"
        self.sentence, self.is_port_taken = "", False

    @property
    def url(self) -> str:
        """Address of the server, without the token."""
        port = self.port if self._server is None else self._server.port
        return f"ws://{self.host or '127.0.0.1'}:{port}"

    @property
    def full_url(self) -> str:
        """Address of the server, with the token if it requires one."""
        return f"{self.url}/?token={self.token}" if self.token else self.url

    @property
    def pages(self) -> tuple[context.ConnectedPage, ...]:
        """Connected pages."""
        return () if self._server is None else self._server.pages

    @property
    def refusals(self) -> tuple[context.Refusal, ...]:
        """Refused connections, the newest last."""
        return () if self._server is None else self._server.refusals

    def switch_on(self) -> None:
        """Start the server in the background."""
        if self.state == "off":
            self._begin()

    def switch_off(self) -> None:
        """Disconnect all pages and end the server in the background."""
        self._number += 1
        self.state, self.sentence, self.is_port_taken = "off", "", False
        ended, self._server = self._server, None
        self._in_thread(lambda: ended.close() if ended is not None else None)

    def apply(self) -> None:
        """Restart a running server with the current settings; disconnects all pages."""
        if self.state != "off":
            self.switch_off()
            self._begin()

    def new_token(self) -> None:
        """Replace the token; disconnects all pages."""
        self.token = ""
        self.apply()

    def set_origins(self, text: str) -> None:
        """Set `origins` from text separated by spaces or commas. Raises `NepError` for a malformed one."""
        given = text.replace(",", " ").split()
        self.origins = tuple(dict.fromkeys(map(access.checked_origin, given)))

    def set_robots(self, names: Sequence[str]) -> None:
        """Set `robots`, without duplicates."""
        self.robots = tuple(dict.fromkeys(names))

    def disconnect(self, page_id: int) -> None:
        """Disconnect a page; it can reconnect."""
        if self._server is not None:
            self._server.disconnect(page_id)

    def started(self, event: WebServerStarted) -> None:
        """Apply the result of a start; closes the server if the switch was changed meanwhile."""
        if event.number != self._number:
            if event.server is not None:
                self._in_thread(event.server.close)
            return
        self._server, self.sentence, self.is_port_taken = event.server, event.sentence, event.is_port_taken
        self.state = "off" if event.server is None else "on"

    def check(self) -> None:
        """Detect a server that ended by itself. Called once a second."""
        if self._server is not None and self._server.wait(0):
            self._server, self.state = None, "off"
            self.sentence = _("The web server ended because of an error. The log has the details.")

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
        self.state, self.sentence, self.is_port_taken = "starting", "", False
        self.token = (self.token or access.new_token()) if self.host else ""
        settings = server.WebSettings(
            port=self.port,
            listen=(self.host,) if self.host else (),
            access=access.Access(frozenset(self.origins), self.token),
            allow_moving=frozenset(self.robots),
            master=self._master,
        )

        def work() -> None:
            try:
                running = self._start(settings)
            except AddressInUseError:
                said = _("Port {port} is in use by another program, perhaps rosbridge.")
                self._post_event(WebServerStarted(number, None, said.format(port=settings.port), True))
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
