"""Access to pynng, which is loaded with the first node and can't be used after a fork."""

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
from nep.system.descriptors import check_free_descriptors
from nep.system.exits import call_after_nodes, cancel_after_nodes
from nep.system.forks import call_in_child

MAX_QUEUE_LENGTH = 8192
"""Maximum queue length that pynng allows, in messages. pynng's defaults are too short for bursts."""
_QUEUE_LENGTHS = {"image": 64, "bytes": 1000}
FDS_PER_SOCKET = 6
"""Number of file descriptors that a socket needs, including its port and a connection."""
_PORT_ATTEMPTS = 100
_MODULE_NAME = "pynng.nng"
_exit_handler: Callable[[], object] | None = None
_sockets: WeakSet[Any] = WeakSet()
_inherited_libraries: set[str] = set()
"""Names of libraries that were in use in the parent process before a fork.

They can't be used in the child process, because nng would wait for threads that don't exist there.
"""


def load_pynng(load: Callable[[str], ModuleType] = importlib.import_module) -> Any:  # noqa: ANN401 - not typed
    """Load and return the module pynng.

    Raises:
        BackendUnavailableError: pynng is not installed or can't be loaded.
        NepError: The process was forked from one that uses pynng.
    """
    if _inherited_libraries:
        raise NepError(
            _(
                "'nanomsg' doesn't work in a process forked from a program that uses it; start the process "
                "with multiprocessing's start method 'spawn'"
            )
        )
    try:
        pynng = load("pynng")
    except (ImportError, OSError) as error:
        raise BackendUnavailableError(
            "nanomsg", _("install it with 'pip install nep-studio[nanomsg]'")
        ) from error
    _defer_exit_handler()
    return pynng


def _defer_exit_handler() -> None:
    # pynng's own exit handler would run before the nodes are closed.
    global _exit_handler  # noqa: PLW0603 - one per process
    exit_handler = getattr(sys.modules.get(_MODULE_NAME), "_pynng_atexit", None)
    if exit_handler is not None and _exit_handler is None:
        _exit_handler = exit_handler
        call_after_nodes(exit_handler)


def new_socket(kind: str, **options: object) -> Any:  # noqa: ANN401 - not typed
    """Create a pynng socket.

    Args:
        kind: Name of the class, such as "Pub0".
        options: Arguments of the constructor.
    """
    socket = getattr(load_pynng(), kind)(**options)
    _sockets.add(socket)
    return socket


def prevent_finalization(instance: Any) -> None:  # noqa: ANN401 - pynng is not typed
    """Prevent an object from ever being finalized, even at exit."""
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(instance))


def _forked() -> None:
    # Closing a socket in a forked child would block forever, even at exit.
    if _MODULE_NAME not in sys.modules:
        return
    _inherited_libraries.add("pynng")
    for socket in _sockets:
        prevent_finalization(socket)  # the finalizer would close it
    exit_handler = getattr(sys.modules[_MODULE_NAME], "_pynng_atexit", None)
    if exit_handler is not None:
        atexit.unregister(exit_handler)
        cancel_after_nodes(exit_handler)


call_in_child(_forked)


def queue_length(codec: str) -> int:
    """Return the queue length per connection in messages for a codec. pynng has no limit in bytes."""
    return _QUEUE_LENGTHS.get(codec, MAX_QUEUE_LENGTH)


def bound_port(listener: Any) -> int:  # noqa: ANN401 - not typed
    """Return the port to which a listener is bound."""
    return int(str(listener.local_address).rpartition(":")[2])


def listen(socket: Any, address: str, owner: str) -> Any:  # noqa: ANN401 - not typed
    """Listen at `HOST:PORT` and return the listener. Port 0 selects a port not used by the original NEP.

    Args:
        socket: Socket of pynng.
        address: Address as `HOST:PORT`.
        owner: Owner of the socket, for error messages.

    Raises:
        AddressInUseError: The address can't be bound.
        TooManyFilesError: The process is out of file descriptors.
    """
    nng = load_pynng()
    check_free_descriptors(FDS_PER_SOCKET, owner)
    for _try in range(_PORT_ATTEMPTS):
        try:
            listener = socket.listen(f"tcp://{address}")
        except nng.AddressInUse as error:
            raise AddressInUseError(address) from error
        except nng.NNGException as error:
            raise AddressInUseError(address, is_own=False) from error
        if not address.endswith(":0") or bound_port(listener) not in ORIGINAL_PORTS:
            return listener
        listener.close()
    raise AddressInUseError(f"{host_of(address) or LOOPBACK}:*")
