"""Addresses besides loopback at which a master serves other computers."""

from __future__ import annotations

import contextlib
import ipaddress
import logging
from collections.abc import Callable, Iterable

import zmq

from nep.errors import AddressInUseError, NepError
from nep.i18n import _
from nep.protocol.graph_view import Alert
from nep.system.addresses import ANY_HOST, OwnAddress, endpoint_of, own_addresses

_logger = logging.getLogger("nep.master")


def check_hosts(hosts: Iterable[str], addresses: Iterable[OwnAddress]) -> tuple[str, ...]:
    """Validate addresses and return them without duplicates.

    `ANY_HOST` and loopback addresses are always valid.

    Args:
        hosts: Addresses to validate.
        addresses: Addresses of this computer, as returned by `own_addresses`.

    Raises:
        NepError: An address isn't an IPv4 address, or doesn't belong to this computer.
    """
    own_hosts = {own_address.host for own_address in addresses}
    unique_hosts = tuple(dict.fromkeys(hosts))
    for host in unique_hosts:
        try:
            address = ipaddress.IPv4Address(host)
        except ValueError:
            raise NepError(
                _("'{host}' isn't an IPv4 address; use an address such as '192.168.1.20'").format(host=host)
            ) from None
        if host != ANY_HOST and host not in own_hosts and not address.is_loopback:
            others = ", ".join(sorted(own_hosts)) or _(
                "none that other computers can reach; connect to a network first"
            )
            raise NepError(
                _("'{host}' isn't an address of this computer; its addresses: {others}").format(
                    host=host, others=others
                )
            )
    return unique_hosts


class ListenAddresses:
    """Bindings of the master's socket to further addresses of this computer, updated when addresses change.

    Only for the master's thread.

    Args:
        router: Socket of the master.
        port: Port of all addresses.
        list_addresses: Returns the addresses of this computer.
    """

    def __init__(
        self,
        router: zmq.Socket[bytes],
        port: int,
        list_addresses: Callable[[], tuple[OwnAddress, ...]] = own_addresses,
    ) -> None:
        self.hosts: tuple[str, ...] = ()
        """Requested addresses."""
        self._router = router
        self._port = port
        self._list_addresses = list_addresses
        self._bound_hosts: set[str] = set()

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Bound endpoints, without the master's own address."""
        return tuple(endpoint_of(f"{host}:{self._port}") for host in self._bound_hosts)

    def serve(self, hosts: Iterable[str]) -> None:
        """Bind to exactly these addresses and release all others; `ANY_HOST` means all addresses.

        Raises `NepError` for an address that isn't an IPv4 address of this computer, and
        `AddressInUseError` for a port in use. If it raises, the bindings are unchanged.
        """
        addresses = self._list_addresses()
        checked_hosts = check_hosts(hosts, addresses)
        new_hosts: list[str] = []
        try:
            for host in self._available_hosts(checked_hosts, addresses) - self._bound_hosts:
                self._bind(host)
                new_hosts.append(host)
        except NepError:
            for host in new_hosts:
                self._unbind(host)
            raise
        self.hosts = checked_hosts
        for host in self._bound_hosts - self._available_hosts(checked_hosts, addresses):
            self._unbind(host)

    def refresh(self) -> tuple[Alert, ...]:
        """Update the bindings to the computer's current addresses; return alerts for missing addresses."""
        if not self.hosts:
            return ()
        addresses = self._list_addresses()
        available = self._available_hosts(self.hosts, addresses)
        for host in self._bound_hosts - available:
            self._unbind(host)
        for host in available - self._bound_hosts:
            with contextlib.suppress(AddressInUseError):  # retried at the next call
                self._bind(host)
        return tuple(
            self._lost_alert(host, addresses)
            for host in self.hosts
            if host != ANY_HOST and host not in self._bound_hosts
        )

    def _available_hosts(self, hosts: tuple[str, ...], addresses: tuple[OwnAddress, ...]) -> set[str]:
        present = {own_address.host for own_address in addresses}
        if ANY_HOST in hosts:
            return present
        return {host for host in hosts if host in present or ipaddress.IPv4Address(host).is_loopback}

    def _lost_alert(self, host: str, addresses: tuple[OwnAddress, ...]) -> Alert:
        current_hosts = ", ".join(own_address.host for own_address in addresses)
        return Alert(
            f"listen:{host}",
            _(
                "This computer no longer has the address {host}, so other computers can't reach its programs"
            ).format(host=host),
            _("Use another address on the other computers: {hosts}.").format(hosts=current_hosts)
            if current_hosts
            else _("Reconnect to the network."),
        )

    def _bind(self, host: str) -> None:
        address = f"{host}:{self._port}"
        try:
            self._router.bind(endpoint_of(address))
        except zmq.ZMQError as error:
            raise AddressInUseError(address) from error
        self._bound_hosts.add(host)

    def _unbind(self, host: str) -> None:
        try:
            self._router.unbind(endpoint_of(f"{host}:{self._port}"))
        except zmq.ZMQError as error:  # the address has disappeared, and with it the binding
            _logger.debug("failed to unbind '%s': %s", host, error)
        self._bound_hosts.discard(host)
