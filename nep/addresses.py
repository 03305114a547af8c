"""Where the master is."""

from __future__ import annotations

import os
import re

from nep.errors import NepError

__all__ = ["DEFAULT_MASTER", "MASTER_VARIABLE", "endpoint_of", "host_of", "is_loopback", "master_address"]

MASTER_VARIABLE = "NEP_MASTER"
DEFAULT_MASTER = "127.0.0.1:7780"
_DEFAULT_PORT = 7780
_HOST = re.compile(r"[\w.-]+|\*|\[[\w:.%]+\]", re.ASCII)


def master_address(address: str | None = None) -> str:
    """`address`, else $NEP_MASTER, else "127.0.0.1:7780"; the port 7780 is added when there is none."""
    chosen = (address or os.environ.get(MASTER_VARIABLE) or DEFAULT_MASTER).removeprefix("tcp://")
    host, colon, port = chosen.rpartition(":")
    if not colon:
        chosen, host, port = f"{chosen}:{_DEFAULT_PORT}", chosen, str(_DEFAULT_PORT)
    if not _HOST.fullmatch(host) or not port.isdigit() or int(port) > 65535:
        raise NepError(f"'{chosen}' is no address of a master; write it as '{DEFAULT_MASTER}'")
    return chosen


def endpoint_of(address: str) -> str:
    """The ZeroMQ endpoint of an address."""
    return f"tcp://{address}"


def host_of(address: str) -> str:
    """The host in an address."""
    return address.rpartition(":")[0]


def is_loopback(address: str) -> bool:
    """Whether only programs of this computer reach it."""
    return host_of(address) in {"127.0.0.1", "localhost", "[::1]"}
