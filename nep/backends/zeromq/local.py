"""Local: the names of this computer at which publishers are reached beside TCP's loopback.

Programs of one computer exchange small messages quicker through a Unix socket than through TCP, see
docs/adr/0011-local-sockets.md; messages of hundreds of kilobytes wait for its small buffer. Only Linux has
names for them that are no files, which somebody would have to clean up after a crash. A name holds the
publisher's loopback port, and that belongs to no other program.
With `NEP_LOCAL=0` publishers leave this out, for whoever wants to see the traffic with a network tool.
"""

from __future__ import annotations

import logging
import os
import socket
import sys
from dataclasses import replace

import zmq

from nep.backends.zeromq.sockets import LOOPBACK, Socket
from nep.protocol.records import RemotePublisher
from nep.system.addresses import is_loopback
from nep.system.descriptors import has_room
from nep.system.interfaces import nearest

__all__ = ["SMALL", "bind_beside", "in_reach", "is_there", "local_of", "may_stay"]

_logger = logging.getLogger("nep")

SMALL = frozenset({"json", "string", "msgpack"})
"""Codecs of what is small as a rule: commands, answers, states."""
_TCP = f"tcp://{LOOPBACK}:"
_LOCAL = "ipc://@nep-"
_ROOM_TO_BIND = 384
_ROOM_TO_STAY = 192
"""So many connections at once come to nobody within the second in which room is looked for again."""
_reached: set[bool] = set()
"""Holds True once a program was reached in this way: then none is tried out any more."""


def is_there() -> bool:
    """Whether this computer has such names."""
    return sys.platform == "linux" and zmq.has("ipc")


def may_stay() -> bool:
    """Whether this process has room for those who come by such a name.

    libzmq 4.3 ends the program when it has no descriptor for them; who comes by TCP just waits.
    """
    return has_room(_ROOM_TO_STAY)


def local_of(endpoint: str) -> str:
    """The name beside a loopback endpoint; "" for any other."""
    return f"{_LOCAL}{endpoint.removeprefix(_TCP)}" if endpoint.startswith(_TCP) else ""


def bind_beside(owner: Socket, endpoint: str) -> str:
    """Bind to the name beside a loopback endpoint; "" when it cannot be: then there is TCP."""
    name = (
        local_of(endpoint)
        if is_there() and has_room(_ROOM_TO_BIND) and os.environ.get("NEP_LOCAL", "") != "0"
        else ""
    )
    if name:
        try:
            owner.bind(name)
        except zmq.ZMQError as error:
            _logger.debug("'%s' could not be bound: %s", name, error)
            return ""
    return name


def _is_reached(name: str) -> bool:
    """Whether a program can be reached by this name: a sandbox may forbid it. Asked in earnest only once."""
    if not _reached:
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
                probe.connect("\0" + name.removeprefix("ipc://@"))
        except OSError as error:
            _logger.debug("'%s' could not be reached: %s", name, error)
            return False
        _reached.add(True)
    return True


def in_reach(remote: RemotePublisher, master: str) -> RemotePublisher:
    """A publisher with the one endpoint at which a program reaches it that knows its master as `master`.

    On the master's computer that is the publisher's name, where it has one.
    """
    publisher = remote.publisher
    if not publisher.endpoints:
        return remote
    chosen = nearest(publisher.endpoints, master)
    if publisher.local and is_there() and is_loopback(master):
        name = local_of(chosen)
        chosen = name if name and _is_reached(name) else chosen
    return replace(remote, publisher=replace(publisher, endpoints=(chosen,) if chosen else ()))
