"""Addresses of the master, of this computer, and of reachable publishers."""

from __future__ import annotations

import ipaddress
import logging
import os
import re
import socket
import threading
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from nep.errors import NepError, WrongTypeError
from nep.i18n import _
from nep.system.lazy_import import lazy_module
from nep.text import quotable

if TYPE_CHECKING:
    import psutil
else:
    psutil = lazy_module("psutil")


_logger = logging.getLogger("nep")

LOOPBACK = "127.0.0.1"
ORIGINAL_PORTS = frozenset({7000, 7777, 7780, 12345, 50000, *range(9000, 10000)})
"""Ports that have a fixed meaning for programs of the original NEP."""
MASTER_VARIABLE = "NEP_MASTER"
DEFAULT_MASTER = "127.0.0.1:7780"
_DEFAULT_PORT = 7780
_HOST_PATTERN = re.compile(r"[\w.-]+|\*", re.ASCII)
_NUMERIC_HOST = re.compile(r"[\d.]+", re.ASCII)
_PORT_PATTERN = re.compile(r"\d{1,5}", re.ASCII)
_OCTET_PATTERN = re.compile(r"0*\d{1,3}", re.ASCII)
_ENDPOINT_PATTERN = re.compile(r"tcp://[\w.-]{1,253}:(\d{1,5})|ipc://@nep-(\d{1,5})", re.ASCII)

ANY_HOST = "0.0.0.0"  # noqa: S104 - bound only at a user's request
"""IPv4 address that stands for all interfaces of a computer."""
_RETRY_INTERVAL_S = 5.0
_WAIT_SLICE_S = 0.1
_LOCAL_NAMES = frozenset({"localhost", "*"})
"""Host names of this computer that need no resolution; "*" is a master on all interfaces."""
_TUNNEL_PREFIXES = ("docker", "br-", "veth", "virbr", "tun", "tap", "wg", "utun", "vmnet")


def master_address(address: str | None = None) -> str:
    """Return the master's address: `address`, else $NEP_MASTER, else "127.0.0.1:7780".

    Port 7780 is appended if the address has no port. Raises `NepError` for an invalid address.
    """
    if address is not None and not isinstance(address, str):
        raise WrongTypeError(
            _("an address must be a 'str' such as '{example}', not a '{kind}'").format(
                example=DEFAULT_MASTER, kind=type(address).__name__
            )
        )
    resolved = (address or os.environ.get(MASTER_VARIABLE) or DEFAULT_MASTER).removeprefix("tcp://")
    if _is_ipv6(resolved):
        check_host(resolved)
    host, colon, port = resolved.rpartition(":")
    if not colon:
        resolved, host, port = f"{resolved}:{_DEFAULT_PORT}", resolved, str(_DEFAULT_PORT)
    if not _HOST_PATTERN.fullmatch(host) or not _is_valid_host(host) or not _is_port(port):
        raise NepError(
            _("'{chosen}' isn't a valid address of a master; use an address such as '{example}'").format(
                chosen=quotable(resolved), example=DEFAULT_MASTER
            )
        )
    return resolved


def check_host(host: object) -> str:
    """Validate a host to connect to or bind, and return it: an IPv4 address, a host name, or "*".

    Raises `NepError` if the host is invalid.
    """
    if isinstance(host, str) and _is_ipv6(host):
        raise NepError(
            _(
                "'{host}' is an IPv6 address, which nep doesn't support; use an IPv4 address such as "
                "'127.0.0.1', or the computer's name"
            ).format(host=quotable(host))
        )
    if isinstance(host, str) and "://" in host:
        raise NepError(
            _("'{host}' is a URL; use only the address, such as '127.0.0.1', or the computer's name").format(
                host=quotable(host)
            )
        )
    if not isinstance(host, str) or not _HOST_PATTERN.fullmatch(host) or not _is_valid_host(host):
        raise NepError(
            _(
                "'{host}' isn't a valid computer address; use an IP address such as '127.0.0.1', or the "
                "computer's name"
            ).format(host=quotable(str(host)))
        )
    return host


def _is_ipv6(address: str) -> bool:
    # Also in brackets and with a port.
    host = address[1:].partition("]")[0] if address.startswith("[") else address
    try:
        ipaddress.IPv6Address(host)
    except ValueError:
        return False
    return True


def _is_port(text: str) -> bool:
    return _PORT_PATTERN.fullmatch(text) is not None and int(text) <= 65535


def _is_valid_host(host: str) -> bool:
    if not _NUMERIC_HOST.fullmatch(host):
        return True
    numbers = host.split(".")
    return len(numbers) == 4 and all(
        _OCTET_PATTERN.fullmatch(each) and int(each[-3:]) < 256 for each in numbers
    )


def is_endpoint(endpoint: str) -> bool:
    """Return True if the text is a valid endpoint of a publisher: tcp://HOST:PORT or ipc://@nep-PORT."""
    match = _ENDPOINT_PATTERN.fullmatch(endpoint)
    return match is not None and 0 < int(match[1] or match[2]) < 65536


def endpoint_of(address: str) -> str:
    """Convert an address HOST:PORT to a ZeroMQ endpoint."""
    return f"tcp://{address}"


def host_of(address: str) -> str:
    """Return the host of an address HOST:PORT."""
    return address.rpartition(":")[0]


def is_loopback(address: str) -> bool:
    """Return True if the host of an address is 127.0.0.1 or localhost."""
    return host_of(address) in {"127.0.0.1", "localhost"}


class OwnAddress(NamedTuple):
    """IPv4 address of this computer and the name of its network interface, such as "wlan0"."""

    host: str
    interface: str


def own_addresses() -> tuple[OwnAddress, ...]:
    """Return the addresses at which other computers may reach this one; tunnels and containers come last."""
    active_interfaces = {name for name, stats in psutil.net_if_stats().items() if stats.isup}
    candidates = [
        OwnAddress(each.address, name)
        for name, addresses in psutil.net_if_addrs().items()
        for each in addresses
        if name in active_interfaces and each.family == socket.AF_INET and not _is_hidden(each.address)
    ]
    return tuple(sorted(candidates, key=lambda own: (_is_tunnel(own.interface), own.interface, own.host)))


def has_address(host: str) -> bool:
    """Return True if this computer has the IP address `host`, also for 0.0.0.0 and loopback addresses."""
    if host == ANY_HOST or ipaddress.ip_address(host).is_loopback:
        return True
    addresses = (each.address for group in psutil.net_if_addrs().values() for each in group)
    return host in addresses


def reachable_endpoint(endpoints: Sequence[str], master: str) -> str:
    """Return the first of a publisher's endpoints that this program can reach, or "" if none is reachable.

    If the master's address is a loopback address, this program runs on the master's computer and prefers
    loopback endpoints. Otherwise loopback endpoints are skipped, and 0.0.0.0 is replaced with the master's
    host.

    Args:
        endpoints: Endpoints of the publisher.
        master: Address of this program's master.
    """
    addresses = {endpoint: endpoint.rpartition("://")[2] for endpoint in endpoints}
    if is_loopback(master):
        local = [endpoint for endpoint, address in addresses.items() if is_loopback(address)]
        return (local or [*endpoints, ""])[0]
    for endpoint, address in addresses.items():
        if host_of(address) == ANY_HOST:
            return f"{endpoint.removesuffix(address)}{host_of(master)}:{address.rpartition(':')[2]}"
        if not is_loopback(address):
            return endpoint
    return ""


def _is_hidden(host: str) -> bool:
    address = ipaddress.ip_address(host)
    return address.is_loopback or address.is_link_local


def _is_tunnel(interface: str) -> bool:
    return interface.lower().startswith(_TUNNEL_PREFIXES)


# ---- name resolution


def resolve_host(host: str) -> str:
    """Resolve a host name to its first IPv4 address.

    Can block for half a minute. Raises `OSError` or `UnicodeError` if the name can't be resolved.
    """
    return str(socket.getaddrinfo(host, None, socket.AF_INET, socket.SOCK_STREAM)[0][4][0])


def resolve_address(address: str) -> str:
    """Resolve the host name of an address HOST:PORT, and return the address with an IPv4 host.

    Blocks until the name is resolved. Raises `NepError` if the name can't be resolved.
    """
    host = host_of(address)
    if _is_numeric(host):
        return address
    try:
        return f"{resolve_host(host)}:{address.rpartition(':')[2]}"
    except (OSError, UnicodeError) as error:
        raise NepError(
            _("unknown computer '{host}'; check the spelling, or use its IP address").format(host=host)
        ) from error


class MasterNameResolver:
    """Resolver of the master's host name in a background thread.

    Resolution can take half a minute, and libzmq would resolve again in its I/O thread at each connection
    attempt. Therefore a short-lived thread resolves the name, only while the master is not connected, and
    libzmq gets numeric addresses.

    Args:
        address: Address of the master; a numeric address needs no resolution.
        on_change: Called in the resolver thread with each new value of the attribute `address`.
        look_up: Resolves a host name.
    """

    def __init__(
        self, address: str, on_change: Callable[[str], None], look_up: Callable[[str], str] = resolve_host
    ) -> None:
        self.address = ""
        """Address with a numeric host, or "" until the name is resolved."""
        self._host, self._port = host_of(address), address.rpartition(":")[2]
        self._on_change = on_change
        self._resolve_host = look_up
        self._thread: threading.Thread | None = None
        self._retry_at = 0.0
        self._is_failure_logged = False
        self._resolved = threading.Event()
        host = "127.0.0.1" if self._host in _LOCAL_NAMES else self._host
        if _is_numeric(host):
            self.address = f"{host}:{self._port}"
            self._resolved.set()

    def resolve(self, now: float) -> None:
        """Start to resolve the name again, unless the host is numeric or the last attempt was recent.

        Call this while the master is not connected.

        Args:
            now: Current time of the monotonic clock in seconds.
        """
        is_resolving = self._thread is not None and self._thread.is_alive()
        if _is_numeric(self._host) or self._host in _LOCAL_NAMES or is_resolving or now < self._retry_at:
            return
        self._retry_at = now + _RETRY_INTERVAL_S
        thread = threading.Thread(target=self._resolve, name=f"nep-name-{self._host}", daemon=True)
        try:
            thread.start()
        except RuntimeError:
            return  # no thread can be started now
        self._thread = thread

    def wait(self, timeout_s: float | None) -> bool:
        """Wait until the name is resolved; return False after the time limit (None: no limit)."""
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        while not self._resolved.is_set():
            remaining_s = (
                _WAIT_SLICE_S if deadline is None else min(_WAIT_SLICE_S, deadline - time.monotonic())
            )
            if remaining_s <= 0.0:
                return False
            self._resolved.wait(remaining_s)
        return True

    def _resolve(self) -> None:
        try:
            address = f"{self._resolve_host(self._host)}:{self._port}"
        except (OSError, UnicodeError) as error:
            if not self._is_failure_logged:
                self._is_failure_logged = True
                _logger.info(  # `MasterUnreachable` reports it to callers
                    "can't resolve the master's host name '%s' (%s); retrying", self._host, error
                )
            return
        self._is_failure_logged = False
        if address != self.address:
            self.address = address
            self._on_change(address)
        self._resolved.set()


def _is_numeric(host: str) -> bool:
    try:
        ipaddress.IPv4Address(host)
    except ValueError:
        return False
    return True
