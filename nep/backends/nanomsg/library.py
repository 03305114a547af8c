"""The library pynng: found when the first node asks for it, and what all its sockets here have in common."""

from __future__ import annotations

import atexit
import ctypes
import importlib
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any
from weakref import WeakSet

from nep.backends.zeromq.sockets import LOOPBACK, ORIGINAL_PORTS
from nep.errors import AddressInUseError, BackendUnavailableError, NepError
from nep.i18n import _
from nep.system.addresses import host_of
from nep.system.descriptors import check_room
from nep.system.exits import after_nodes, not_after_nodes
from nep.system.forks import in_child

__all__ = [
    "MOST",
    "SOCKET_FILES",
    "bound_port",
    "keep_for_ever",
    "library",
    "listen",
    "new_socket",
    "queue_of",
]

MOST = 8192
"""The largest queue that pynng allows, in messages. Its own ones are so small that a burst overruns them."""
_QUEUES = {"image": 64, "bytes": 1000}
SOCKET_FILES = 6
"""A socket, its port, its signals, and a connection."""
_TRIES = 100
_MODULE = "pynng.nng"
_at_exit: Callable[[], object] | None = None
_sockets: WeakSet[Any] = WeakSet()
_inherited: set[str] = set()
"""The names of libraries that came with a fork: nng's threads stayed behind, and it waits for them."""


def library(load: Callable[[str], ModuleType] = importlib.import_module) -> Any:  # noqa: ANN401 - it has no types
    """Pynng. Raises `BackendUnavailableError` where it is not installed or its library does not load.

    Raises `NepError` in a child that was forked from a program that uses it.
    """
    if _inherited:
        raise NepError(
            _(
                "'nanomsg' does not work in a program that was forked from one that uses it; start it anew, "
                "with multiprocessing by the method 'spawn'"
            )
        )
    try:
        loaded = load("pynng")
    except (ImportError, OSError) as error:
        raise BackendUnavailableError(
            "nanomsg", _("install it with 'pip install nep-studio[nanomsg]'")
        ) from error
    _end_after_nodes()
    return loaded


def _end_after_nodes() -> None:
    """Let nng end after the nodes that use it, once: pynng's own hook would come first."""
    global _at_exit  # noqa: PLW0603 - there is one a process
    at_exit = getattr(sys.modules.get(_MODULE), "_pynng_atexit", None)
    if at_exit is not None and _at_exit is None:
        _at_exit = at_exit
        after_nodes(at_exit)


def new_socket(kind: str, **options: object) -> Any:  # noqa: ANN401 - it has no types
    """One of pynng's sockets, such as "Pub0", with these options."""
    made = getattr(library(), kind)(**options)
    _sockets.add(made)
    return made


def keep_for_ever(owned: Any) -> None:  # noqa: ANN401 - pynng has no types
    """Let nobody forget it, not even the end of the interpreter."""
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(owned))


def _forked() -> None:
    """In a child: nothing of nng may be closed, not even when the interpreter ends: that would never end."""
    if _MODULE not in sys.modules:
        return
    _inherited.add("pynng")
    for socket in _sockets:
        keep_for_ever(socket)  # one that is forgotten closes itself
    at_exit = getattr(sys.modules[_MODULE], "_pynng_atexit", None)
    if at_exit is not None:
        atexit.unregister(at_exit)
        not_after_nodes(at_exit)


in_child(_forked)


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
