"""Where the master is."""

from __future__ import annotations

import os
import re

from nep.arguments import WrongTypeError
from nep.errors import NepError

__all__ = [
    "DEFAULT_MASTER",
    "MASTER_VARIABLE",
    "checked_host",
    "endpoint_of",
    "host_of",
    "is_endpoint",
    "is_loopback",
    "master_address",
]

MASTER_VARIABLE = "NEP_MASTER"
DEFAULT_MASTER = "127.0.0.1:7780"
_DEFAULT_PORT = 7780
_HOST = re.compile(r"[\w.-]+|\*", re.ASCII)
_NUMBERS = re.compile(r"[\d.]+", re.ASCII)
_ENDPOINT = re.compile(r"tcp://[\w.-]{1,253}:(\d{1,5})|ipc://@nep-(\d{1,5})", re.ASCII)


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
