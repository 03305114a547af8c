"""The addresses of this computer, and which of a publisher's addresses a program can reach."""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from nep.system.addresses import host_of, is_loopback
from nep.system.lazy_import import later

if TYPE_CHECKING:
    import psutil
else:
    psutil = later("psutil")

__all__ = ["ANY", "OwnAddress", "has_address", "nearest", "own_addresses"]

ANY = "0.0.0.0"  # noqa: S104 - bound only where a person asked for it
"""All addresses of a computer, now and later."""


_TUNNELS = ("docker", "br-", "veth", "virbr", "tun", "tap", "wg", "utun", "vmnet")


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
