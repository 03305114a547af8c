"""Plug-ins: one module binds one description, and adding one is adding one file."""

from __future__ import annotations

import importlib
import logging
import pkgutil
from collections.abc import Mapping
from typing import TYPE_CHECKING, Protocol, TypeVar

from nep.errors import PluginsMissingError
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from importlib import metadata
else:
    metadata = lazy_module("importlib.metadata")

__all__ = ["Named", "discover", "discover_own"]

_logger = logging.getLogger("nep.system.plugins")


class Named(Protocol):
    """What can be a plug-in: something with a name."""

    @property
    def name(self) -> str:
        """The name by which it is chosen."""


T = TypeVar("T", bound=Named)


def discover_own(package: str, attribute: str, kind: type[T]) -> Mapping[str, T]:
    """As `discover`, without entry points: to find these, all that is installed is looked through."""
    found: dict[str, T] = {}
    home = importlib.import_module(package)
    for info in pkgutil.iter_modules(home.__path__, f"{package}."):
        bound = getattr(importlib.import_module(info.name), attribute, None)
        if bound is None:
            continue
        if not isinstance(bound, kind):
            raise TypeError(f"'{info.name}.{attribute}' is no '{kind.__name__}'")
        found[bound.name] = bound
    if not found:
        raise PluginsMissingError(package, attribute)
    return found


def discover(package: str, attribute: str, kind: type[T]) -> Mapping[str, T]:
    """Name → plug-in: what the modules of `package` bind as `attribute`, and entry points of that group.

    Modules that do not bind it are no plug-ins. A third party's entry point that fails is logged and left
    out; it cannot replace one of ours. Raises `PluginsMissingError` when the package has none (a frozen build
    that forgot it), `TypeError` when a module binds something else.
    """
    found = dict(discover_own(package, attribute, kind))
    for point in metadata.entry_points(group=package):
        try:
            bound = point.load()
        except (Exception, SystemExit):
            _logger.exception("the plug-in '%s' of '%s' cannot be loaded", point.name, package)
            continue
        if isinstance(bound, kind):
            found.setdefault(bound.name, bound)
        else:
            _logger.error("the plug-in '%s' of '%s' is no '%s'", point.name, package, kind.__name__)
    return found
