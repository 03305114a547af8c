"""Access to pynng, which is loaded with the first node and can't be used after a fork."""

from __future__ import annotations

import atexit
import importlib
import sys
import threading
from collections.abc import Callable
from types import ModuleType
from typing import Any
from weakref import WeakSet

from nep.backends.bases.optional_library import OptionalLibrary
from nep.errors import AddressInUseError
from nep.i18n import _
from nep.messages.codecs import Codec
from nep.system.addresses import LOOPBACK, ORIGINAL_PORTS, host_of
from nep.system.descriptors import check_free_descriptors
from nep.system.exits import call_after_nodes, cancel_after_nodes
from nep.system.forks import call_in_child, prevent_finalization
from nep.system.waits import wait_until

MAX_QUEUE_LENGTH = 8192
"""Maximum queue length that pynng allows, in messages. pynng's defaults are too short for bursts."""
FDS_PER_SOCKET = 6
"""Number of file descriptors that a socket needs, including its port and a connection."""
FDS_PER_CONNECTION = 2
"""Number of file descriptors that another connection of a socket needs."""
_PORT_ATTEMPTS = 100
_MODULE_NAME = "pynng.nng"
_exit_handler: Callable[[], object] | None = None
_sockets: WeakSet[Any] = WeakSet()
_library = OptionalLibrary("nanomsg", lambda: _("install it with 'pip install nep-studio[nanomsg]'"))


def load_pynng(load: Callable[[str], ModuleType] = importlib.import_module) -> Any:  # noqa: ANN401 - not typed
    """Load and return the module pynng.

    Raises:
        BackendUnavailableError: pynng is not installed or can't be loaded.
        NepError: The process was forked from one that uses pynng.
    """
    pynng = _library.load(lambda: load("pynng"))
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


class Connections:
    """Number of a socket's connections, for which threads can wait.

    Args:
        socket: Socket of pynng that is neither bound nor connected yet.
    """

    def __init__(self, socket: Any) -> None:  # noqa: ANN401 - not typed
        self._changed = threading.Condition()
        self._pipe_ids: set[int] = set()
        socket.add_post_pipe_connect_cb(lambda pipe: self._update(self._pipe_ids.add, pipe.id))
        socket.add_post_pipe_remove_cb(lambda pipe: self._update(self._pipe_ids.discard, pipe.id))

    def _update(self, change: Callable[[int], None], pipe_id: int) -> None:
        with self._changed:
            change(pipe_id)
            self._changed.notify_all()

    def __len__(self) -> int:
        return len(self._pipe_ids)

    def wait_for_any(self, timeout_s: float) -> None:
        """Wait up to `timeout_s` seconds for a connection."""
        with self._changed:
            wait_until(self._changed, lambda: bool(self._pipe_ids), timeout_s)

    def wait_for_none(self, timeout_s: float) -> None:
        """Wait up to `timeout_s` seconds until all connections are closed."""
        with self._changed:
            wait_until(self._changed, lambda: not self._pipe_ids, timeout_s)


def _forked() -> None:
    # Closing a socket in a forked child would block forever, even at exit.
    if _MODULE_NAME not in sys.modules:
        return
    _library.has_forked = True
    prevent_finalization(*_sockets)  # the finalizer would close them
    exit_handler = getattr(sys.modules[_MODULE_NAME], "_pynng_atexit", None)
    if exit_handler is not None:
        atexit.unregister(exit_handler)
        cancel_after_nodes(exit_handler)


call_in_child(_forked)


def queue_length(codec: Codec) -> int:
    """Return the queue length per connection in messages for a codec. pynng has no limit in bytes."""
    return codec.queue_length or MAX_QUEUE_LENGTH


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
