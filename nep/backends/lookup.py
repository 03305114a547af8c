"""Choosing a back end by its name."""

from __future__ import annotations

from collections.abc import Iterable

from nep.backends.base import Backend
from nep.errors import PluginsMissingError, UnknownBackendError
from nep.system.descriptors import check_room
from nep.system.plugins import discover, discover_own

__all__ = ["backend_named"]


def backend_named(name: str) -> Backend:
    """The back end of this name, or of which it is an alias.

    Entry points are looked for only when it is none of ours: a node is made in less than a millisecond.
    Raises `UnknownBackendError`, `TooManyFilesError`.
    """
    try:
        own = discover_own("nep.backends", "BACKEND", Backend)
    except PluginsMissingError:
        check_room(1, "a node")  # without a file to open a folder seems to be empty
        raise
    backend = _named(name.lower(), own.values())
    if backend is None:
        known = discover("nep.backends", "BACKEND", Backend)
        backend = _named(name.lower(), known.values())
        if backend is None:
            raise UnknownBackendError(name, sorted(known))
    return backend


def _named(name: str, backends: Iterable[Backend]) -> Backend | None:
    return next((each for each in backends if name in {each.name, *each.aliases}), None)
