"""Where the master is; the addresses of this computer, and which of a publisher's addresses are in reach."""

from __future__ import annotations

import ipaddress
import os
import re
import socket
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from nep.errors import NepError, WrongTypeError
from nep.system.lazy_import import later

if TYPE_CHECKING:
    import psutil
else:
    psutil = later("psutil")

__all__ = [
    "ANY",
    "DEFAULT_MASTER",
    "MASTER_VARIABLE",
    "OwnAddress",
    "checked_host",
    "endpoint_of",
    "has_address",
    "host_of",
    "is_endpoint",
    "is_loopback",
    "master_address",
    "nearest",
    "own_addresses",
]

MASTER_VARIABLE = "NEP_MASTER"
DEFAULT_MASTER = "127.0.0.1:7780"
_DEFAULT_PORT = 7780
_HOST = re.compile(r"[\w.-]+|\*", re.ASCII)
_NUMBERS = re.compile(r"[\d.]+", re.ASCII)
_ENDPOINT = re.compile(r"tcp://[\w.-]{1,253}:(\d{1,5})|ipc://@nep-(\d{1,5})", re.ASCII)

ANY = "0.0.0.0"  # noqa: S104 - bound only where a person asked for it
"""All addresses of a computer, now and later."""
_TUNNELS = ("docker", "br-", "veth", "virbr", "tun", "tap", "wg", "utun", "vmnet")


def master_address(address: str | None = None) -> str:
    """`address`, else $NEP_MASTER, else "127.0.0.1:7780"; the port 7780 is added when there is none."""
    if address is not None and not isinstance(address, str):
        raise WrongTypeError(
            f"an address is a 'str' such as '{DEFAULT_MASTER}', not a '{type(address).__name__}'"
        )
    chosen = (address or os.environ.get(MASTER_VARIABLE) or DEFAULT_MASTER).removeprefix("tcp://")
    if "://" not in chosen and ("[" in chosen or chosen.count(":") > 1):
        checked_host(chosen)
    host, colon, port = chosen.rpartition(":")
    if not colon:
        chosen, host, port = f"{chosen}:{_DEFAULT_PORT}", chosen, str(_DEFAULT_PORT)
    if not _HOST.fullmatch(host) or not _is_possible(host) or not port.isdigit() or int(port) > 65535:
        raise NepError(f"'{chosen}' is no address of a master; write it as '{DEFAULT_MASTER}'")
    return chosen


def checked_host(host: object) -> str:
    """`host` itself when it may be connected to or bound: an IPv4 address, a name, or "*".

    Raises `NepError`.
    """
    if isinstance(host, str) and ":" in host:
        raise NepError(
            f"'{host}' is an IPv6 address, which nep does not speak; use one such as '127.0.0.1', "
            "or the computer's name"
        )
    if not isinstance(host, str) or not _HOST.fullmatch(host) or not _is_possible(host):
        raise NepError(f"'{host}' is no address of a computer; use one such as '127.0.0.1', or a name")
    return host


def _is_possible(host: str) -> bool:
    if not _NUMBERS.fullmatch(host):
        return True
    numbers = host.split(".")
    return len(numbers) == 4 and all(each.isdigit() and int(each) < 256 for each in numbers)


def is_endpoint(endpoint: str) -> bool:
    """Whether it is one that a publisher of nep is reached at: tcp://HOST:PORT, or the name beside it."""
    found = _ENDPOINT.fullmatch(endpoint)
    return found is not None and 0 < int(found[1] or found[2]) < 65536


def endpoint_of(address: str) -> str:
    """The ZeroMQ endpoint of an address."""
    return f"tcp://{address}"


def host_of(address: str) -> str:
    """The host in an address."""
    return address.rpartition(":")[0]


def is_loopback(address: str) -> bool:
    """Whether only programs of this computer reach it."""
    return host_of(address) in {"127.0.0.1", "localhost"}


class OwnAddress(NamedTuple):
    """An IPv4 address of this computer and the name of its interface, such as "wlan0"."""

    host: str
    interface: str


def own_addresses() -> tuple[OwnAddress, ...]:
    """The addresses under which other computers may reach this one, best first: wire, Wi-Fi, then tunnels."""
    up = {name for name, stats in psutil.net_if_stats().items() if stats.isup}
    found = [
        OwnAddress(each.address, name)
        for name, addresses in psutil.net_if_addrs().items()
        for each in addresses
        if name in up and each.family == socket.AF_INET and not _is_hidden(each.address)
    ]
    return tuple(sorted(found, key=lambda own: (_is_tunnel(own.interface), own.interface, own.host)))


def has_address(host: str) -> bool:
    """Whether this computer has that address now."""
    if host == ANY or ipaddress.ip_address(host).is_loopback:
        return True
    addresses = (each.address for group in psutil.net_if_addrs().values() for each in group)
    return host in addresses


def nearest(endpoints: Sequence[str], master: str) -> str:
    """The endpoint to connect to for a program that knows its master as `master`; "" when none is in reach.

    Whoever reaches the master by its loopback address is on the master's computer, where loopback endpoints
    are. For everybody else these are nothing, and "all addresses" of that computer is the master's.
    """
    if is_loopback(master):
        local = [each for each in endpoints if is_loopback(each.removeprefix("tcp://"))]
        return (local or [*endpoints, ""])[0]
    for endpoint in endpoints:
        address = endpoint.removeprefix("tcp://")
        if host_of(address) == ANY:
            return f"tcp://{host_of(master)}:{address.rpartition(':')[2]}"
        if not is_loopback(address):
            return endpoint
    return ""


def _is_hidden(host: str) -> bool:
    address = ipaddress.ip_address(host)
    return address.is_loopback or address.is_link_local


def _is_tunnel(interface: str) -> bool:
    return interface.lower().startswith(_TUNNELS)
