"""The library pynng: found when the first node asks for it, and what all its sockets here have in common."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from types import ModuleType
from typing import Any

from nep.backends.zeromq.sockets import LOOPBACK, ORIGINAL_PORTS
from nep.errors import AddressInUseError, BackendUnavailableError
from nep.i18n import _
from nep.system.addresses import host_of
from nep.system.descriptors import check_room

__all__ = ["MOST", "SOCKET_FILES", "bound_port", "library", "listen", "queue_of"]

MOST = 8192
"""The largest queue that pynng allows, in messages. Its own ones are so small that a burst overruns them."""
_QUEUES = {"image": 64, "bytes": 1000}
SOCKET_FILES = 6
"""A socket, its port, its signals, and a connection."""
_TRIES = 100


def library(load: Callable[[str], ModuleType] = importlib.import_module) -> Any:  # noqa: ANN401 - it has no types
    """Pynng. Raises `BackendUnavailableError` where it is not installed or its library does not load."""
    try:
        return load("pynng")
    except (ImportError, OSError) as error:
        raise BackendUnavailableError(
            "nanomsg", _("install it with 'pip install nep-studio[nanomsg]'")
        ) from error


def queue_of(codec: str) -> int:
    """How many messages pynng shall queue for each connection. It bounds them by their number only."""
    return _QUEUES.get(codec, MOST)


def bound_port(listener: Any) -> int:  # noqa: ANN401 - it has no types
    """The port at which it listens."""
    return int(str(listener.local_address).rpartition(":")[2])


def listen(owner: Any, address: str, what: str) -> Any:  # noqa: ANN401 - it has no types
    """Let a socket listen at `HOST:PORT`, with port 0 at a free one that is none of the original NEP's.

    Raises `AddressInUseError`, `TooManyFilesError`.
    """
    nng = library()
    check_room(SOCKET_FILES, what)
    for _try in range(_TRIES):
        try:
            listener = owner.listen(f"tcp://{address}")
        except nng.AddressInUse as error:
            raise AddressInUseError(address) from error
        except nng.NNGException as error:
            raise AddressInUseError(address, is_own=False) from error
        if not address.endswith(":0") or bound_port(listener) not in ORIGINAL_PORTS:
            return listener
        listener.close()
    raise AddressInUseError(f"{host_of(address) or LOOPBACK}:*")
