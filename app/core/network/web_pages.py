"""The server of `nep web` in Studio: off at each start, switched by a person, and what it does."""

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
else:  # most people never start it
    access = lazy_module("nep.programs.web.access")
    context = lazy_module("nep.programs.web.context")
    server = lazy_module("nep.programs.web.server")

DEFAULT_PORT = 9090
END_WAIT_S = 12.0
WebState = Literal["off", "starting", "on"]


class RunningServer(Protocol):
    """What is needed of `nep.programs.web.WebServer`."""

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
        """Whether it has ended within this time."""

    def close(self) -> None:
        """Disconnect everybody and end."""


StartServer = Callable[["server.WebSettings"], RunningServer]
"""Starts a server; raises `NepError`. It may wait, and is called in a thread of its own."""


@dataclass(frozen=True, slots=True)
class WebServerStarted:
    """A start has ended: with a server, or with the sentence that says why there is none."""

    number: int
    server: RunningServer | None
    sentence: str = ""
    is_port_taken: bool = False


def start_server(settings: server.WebSettings) -> RunningServer:
    """A server in a thread of its own. See `StartServer`."""
    return server.WebServer(settings).start()


class WebPages:
    """The switch, its choices and the running server. One thread uses it (the window's).

    `host`: the address of this computer at which others can connect, "" for none. `origins`: origins of pages
    besides those of this computer. `robots`: names of the robots that pages may move. They count from the
    next start on; `apply` restarts a running server with them. Nothing is kept for the next start of Studio.
    """

    def __init__(
        self,
        master: str,
        post_event: Callable[[object], None],
        *,
        start: StartServer = start_server,
        addresses: Callable[[], tuple[OwnAddress, ...]] = own_addresses,
    ) -> None:
        """`master` is the address of the master; nothing is started yet."""
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
        """Where pages connect, without the token."""
        port = self.port if self._server is None else self._server.port
        return f"ws://{self.host or '127.0.0.1'}:{port}"

    @property
    def full_url(self) -> str:
        """Where pages connect, with the token if one is needed."""
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
        """Start the server with the choices; returns at once."""
        if self.state == "off":
            self._begin()

    def switch_off(self) -> None:
        """Disconnect everybody and end the server; returns at once."""
        self._number += 1
        self.state, self.sentence, self.is_port_taken = "off", "", False
        ended, self._server = self._server, None
        self._in_thread(lambda: ended.close() if ended is not None else None)

    def apply(self) -> None:
        """Restart a running server so that the choices count; everybody is disconnected."""
        if self.state != "off":
            self.switch_off()
            self._begin()

    def new_token(self) -> None:
        """Replace the token; everybody is disconnected."""
        self.token = ""
        self.apply()

    def set_origins(self, text: str) -> None:
        """Let pages of these origins, separated by spaces or commas, connect. Raises `NepError`."""
        given = text.replace(",", " ").split()
        self.origins = tuple(dict.fromkeys(map(access.checked_origin, given)))

    def set_robots(self, names: Sequence[str]) -> None:
        """Let pages move the robots of these names, and no others."""
        self.robots = tuple(dict.fromkeys(names))

    def disconnect(self, page_id: int) -> None:
        """Disconnect a page; it may connect again."""
        if self._server is not None:
            self._server.disconnect(page_id)

    def started(self, event: WebServerStarted) -> None:
        """Take over the end of a start; a server that isn't wanted any more is closed."""
        if event.number != self._number:
            if event.server is not None:
                self._in_thread(event.server.close)
            return
        self._server, self.sentence, self.is_port_taken = event.server, event.sentence, event.is_port_taken
        self.state = "off" if event.server is None else "on"

    def check(self) -> None:
        """Notice a server that ended by itself (called once a second)."""
        if self._server is not None and self._server.wait(0):
            self._server, self.state = None, "off"
            self.sentence = _("The web server ended because of an error. The log has the details.")

    def close(self) -> None:
        """End the server and its threads."""
        self.switch_off()
        if self._thread is not None:
            self._thread.join(END_WAIT_S)
        if self._last_started is not None:  # its event may not have been taken over
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
        """Call what waits in a thread, after what was called so before."""
        before = self._thread

        def run() -> None:
            if before is not None:
                before.join()
            work()

        self._thread = threading.Thread(target=run, name="studio-web", daemon=True)
        self._thread.start()
