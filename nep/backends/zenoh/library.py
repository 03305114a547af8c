"""Access to the zenoh library, which is loaded with the first node and can't be used after a fork."""

from __future__ import annotations

import importlib
import logging
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

from nep.backends.bases.optional_library import OptionalLibrary
from nep.i18n import _
from nep.system.forks import call_in_child, prevent_finalization

_logger = logging.getLogger("nep")
_sessions: list[Any] = []
_library = OptionalLibrary("zenoh", lambda: _("install it with 'pip install nep-studio[zenoh]'"))


# zenoh is only partly typed
def load_zenoh(load: Callable[[str], ModuleType] = importlib.import_module) -> Any:  # noqa: ANN401
    """Load and return the module zenoh.

    Raises:
        BackendUnavailableError: zenoh is not installed or can't be loaded.
        NepError: The process was forked from one that uses zenoh.
    """
    return _library.load(lambda: load("zenoh"))


def create_handler(callback: Callable[[Any], None], drop: Callable[[], None] | None = None) -> Any:  # noqa: ANN401 - zenoh is not typed
    """Return a zenoh handler that calls `callback` in zenoh's network thread, which preserves the order.

    Args:
        callback: Called with each sample, reply or query.
        drop: Called when no further call of `callback` follows; None if not needed.
    """
    return importlib.import_module("zenoh.handlers").Callback(callback, drop, indirect=False)


def open_session(config: Any) -> Any:  # noqa: ANN401 - zenoh is not typed
    """Open a session with a zenoh configuration. Raises zenoh's `ZError`."""
    session = load_zenoh().open(config)
    _sessions.append(session)
    return session


def close_session(session: Any) -> None:  # noqa: ANN401 - zenoh is not typed
    """Close a session. Errors of zenoh are logged, not raised."""
    try:
        session.close()
    except BaseException as error:
        # zenoh panics if closing takes ten seconds; the exception isn't derived from `Exception`
        if type(error).__name__ not in {"PanicException", "ZError"}:
            raise
        _logger.warning("zenoh failed to close a session: %s", error)
    finally:
        if session in _sessions:
            _sessions.remove(session)


def _forked() -> None:
    # In a forked child sessions must never be closed, not even by their finalizers: that would block forever.
    if "zenoh" not in sys.modules or not _sessions:
        return
    _library.has_forked = True
    prevent_finalization(*_sessions)


call_in_child(_forked)
