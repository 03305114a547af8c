"""Remote access: permission for programs on other computers to reach the master on this computer."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from app.core.alerts.alerts import Alerts
from app.core.storage.settings import Settings
from app.errors import SettingsError
from app.intents import AllowOtherComputers
from nep.errors import NepError
from nep.i18n import _
from nep.masters.process import listen
from nep.protocol.graph_view import GraphView
from nep.system.addresses import OwnAddress, host_of, is_loopback, own_addresses

ALERT, NOT_SAVED_ALERT = "reach", "reach:kept"


@dataclass(frozen=True, slots=True)
class RemoteAccessChanged:
    """Event: the request to the master to listen on some addresses has succeeded or failed.

    Attributes:
        hosts: Requested addresses.
        message: Reason for a failure, or "".
    """

    hosts: tuple[str, ...]
    message: str = ""


class RemoteAccess:
    """Control of remote access. Not thread-safe; use it from the main thread.

    Requests to the master run in a background thread.
    """

    def __init__(
        self,
        address: str,
        settings: Settings,
        alerts: Alerts,
        post_event: Callable[[object], None],
        *,
        request_listen: Callable[[Sequence[str], str], None] = listen,
        local_addresses: Callable[[], tuple[OwnAddress, ...]] = own_addresses,
    ) -> None:
        # `request_listen` sends the request to the master at `address`; `local_addresses` returns this
        # computer's addresses.
        self._address, self._settings, self._alerts = address, settings, alerts
        self._post_event, self._request_listen, self._local_addresses = (
            post_event,
            request_listen,
            local_addresses,
        )
        self._epoch = 0
        self._request_thread: threading.Thread | None = None
        self.hosts: tuple[str, ...] = ()
        """Addresses on which the master listens for other computers."""

    @property
    def is_local(self) -> bool:
        """True if the master runs on this computer. Otherwise its addresses can't be changed."""
        return is_loopback(self._address)

    @property
    def master_host(self) -> str:
        """Host name or IP address of the master."""
        return host_of(self._address)

    def addresses(self) -> tuple[OwnAddress, ...]:
        """Return the addresses of this computer that other computers can reach."""
        return self._local_addresses()

    def environment_variable(self, host: str) -> str:
        """Return the environment variable to set on other computers: ``NEP_MASTER=HOST:PORT``.

        Args:
            host: Address of this computer.
        """
        return f"NEP_MASTER={host}:{self._address.rpartition(':')[2]}"

    def listen_on(self, hosts: Sequence[str]) -> None:
        """Request that the master listens on these addresses, and save them for the next start.

        Args:
            hosts: Addresses of this computer; empty to allow no other computers.
        """
        self._request(tuple(hosts))  # first, because shutting others out must not wait for a disk
        try:
            self._settings.listen_hosts = tuple(hosts)
        except SettingsError as error:
            template = (
                _(
                    "This change couldn't be saved ({error}). After the next start, other computers won't be "
                    "able to connect."
                )
                if hosts
                else _(
                    "This change couldn't be saved ({error}). After the next start, other computers will "
                    "still be able to connect."
                )
            )
            self._alerts.raise_alert(
                NOT_SAVED_ALERT,
                "warn",
                _("The list of allowed connections can't be saved."),
                template.format(error=error),
                button=_("Choose an address"),
                intent=AllowOtherComputers(),
                count=0,
            )
        else:
            self._alerts.resolve(NOT_SAVED_ALERT)

    def update_graph(self, view: GraphView) -> None:
        """Apply a new graph.

        The saved addresses are sent to a new master on this computer that doesn't listen on all of
        them.
        """
        self.hosts = view.listens
        if view.epoch != self._epoch:
            self._epoch = view.epoch
            saved_hosts = self._settings.listen_hosts
            if saved_hosts and self.is_local and set(saved_hosts) - set(self.hosts):
                self._request(saved_hosts)

    def on_changed(self, event: RemoteAccessChanged) -> None:
        """Apply the result of the request: update `hosts`, or raise an alert if the request failed."""
        if not event.message:
            self.hosts = event.hosts
            self._alerts.resolve(ALERT)
            return
        self._alerts.raise_alert(
            ALERT,
            "warn",
            _("Other computers can't connect."),
            f"{event.message[:1].upper()}{event.message[1:]}.",
            button=_("Choose an address"),
            intent=AllowOtherComputers(),
        )

    def close(self) -> None:
        """Wait at most three seconds for the request thread."""
        if self._request_thread is not None:
            self._request_thread.join(3.0)

    def _request(self, hosts: tuple[str, ...]) -> None:
        previous_thread = self._request_thread

        def send_request() -> None:
            if previous_thread is not None:
                previous_thread.join()
            try:
                self._request_listen(hosts, self._address)
            except NepError as error:
                self._post_event(RemoteAccessChanged(hosts, str(error)))
            else:
                self._post_event(RemoteAccessChanged(hosts))

        self._request_thread = threading.Thread(target=send_request, name="studio-reach", daemon=True)
        self._request_thread.start()


def access_status(access: RemoteAccess) -> tuple[str, str, str | None]:
    """Return the icon, the text and the status that the status bar shows for remote access.

    The status is "warn" while other computers can connect to Studio's master, else None.
    """
    if access.hosts:
        return (
            "wifi",
            _("Other computers connect at {addresses}").format(addresses=", ".join(access.hosts)),
            "warn",
        )
    if not access.is_local:
        return "network", _("Master on {master_host}").format(master_host=access.master_host), None
    return "lock", _("This computer only"), None
