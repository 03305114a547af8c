"""The library zenoh: found when the first node asks for it, and left alone after a fork."""

from __future__ import annotations

import ctypes
import importlib
import logging
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

from nep.errors import BackendUnavailableError, NepError
from nep.i18n import _
from nep.system.forks import in_child

__all__ = ["callback", "close_session", "keep_for_ever", "library", "open_session"]

_logger = logging.getLogger("nep")
_sessions: list[Any] = []
_inherited: set[str] = set()
"""The names of libraries that came with a fork: zenoh's threads stayed behind, and it waits for them."""


def library(load: Callable[[str], ModuleType] = importlib.import_module) -> Any:  # noqa: ANN401 - not all of it has types
    """The module zenoh. Raises `BackendUnavailableError` where it is not installed or does not load.

    Raises `NepError` in a child that was forked from a program that uses it.
    """
    if _inherited:
        raise NepError(
            _(
                "'zenoh' does not work in a program that was forked from one that uses it; start it anew, "
                "with multiprocessing by the method 'spawn'"
            )
        )
    try:
        return load("zenoh")
    except (ImportError, OSError) as error:
        raise BackendUnavailableError(
            "zenoh", _("install it with 'pip install nep-studio[zenoh]'")
        ) from error


def callback(take: Callable[[Any], None], drop: Callable[[], None] | None = None) -> Any:  # noqa: ANN401 - zenoh's
    """A handler that is called in the thread that reads the network: what comes keeps its order."""
    return importlib.import_module("zenoh.handlers").Callback(take, drop, indirect=False)


def open_session(config: Any) -> Any:  # noqa: ANN401 - zenoh's
    """A session with this configuration. Raises zenoh's `ZError`."""
    session = library().open(config)
    _sessions.append(session)
    return session


def close_session(session: Any) -> None:  # noqa: ANN401 - zenoh's
    """Close it. What zenoh says of a close that it could not finish is logged."""
    try:
        session.close()
    except BaseException as error:
        # A session that cannot be closed in ten seconds panics, which is no `Exception` in Python.
        if type(error).__name__ not in {"PanicException", "ZError"}:
            raise
        _logger.warning("zenoh could not close a session: %s", error)
    finally:
        if session in _sessions:
            _sessions.remove(session)


def keep_for_ever(owned: Any) -> None:  # noqa: ANN401 - zenoh's
    """In a child: let nobody forget it, for what is forgotten tells the network so."""
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(owned))


def _forked() -> None:
    """In a child: no session may be closed, not even by being forgotten: that would never end."""
    if "zenoh" not in sys.modules or not _sessions:
        return
    _inherited.add("zenoh")
    for session in _sessions:
        keep_for_ever(session)


in_child(_forked)
