"""Plug-ins: a module binds one description, so that adding a plug-in is adding a file."""

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
    """Plug-in: an object with a name."""

    @property
    def name(self) -> str:
        """Name of the plug-in."""


T = TypeVar("T", bound=Named)


def discover_own(package: str, attribute: str, kind: type[T]) -> Mapping[str, T]:
    """Find plug-ins as `discover` does, without entry points, whose search reads all installed packages."""
    found: dict[str, T] = {}
    home = importlib.import_module(package)
    for info in pkgutil.iter_modules(home.__path__, f"{package}."):
        bound = getattr(importlib.import_module(info.name), attribute, None)
        if bound is None:
            continue
        if not isinstance(bound, kind):
            raise TypeError(f"'{info.name}.{attribute}' is not a '{kind.__name__}'")
        found[bound.name] = bound
    if not found:
        raise PluginsMissingError(package, attribute)
    return found


def discover(package: str, attribute: str, kind: type[T]) -> Mapping[str, T]:
    """Return plug-ins by name: objects that modules of `package` bind as `attribute`, and entry points.

    Modules without the attribute are ignored. Entry points of third parties that fail are logged and ignored;
    they can't replace our own plug-ins.

    Raises:
        PluginsMissingError: The package has no plug-ins (left out of a frozen program).
        TypeError: A module binds an object of another type.
    """
    found = dict(discover_own(package, attribute, kind))
    for point in metadata.entry_points(group=package):
        try:
            bound = point.load()
        except (Exception, SystemExit):
            _logger.exception("can't load the plug-in '%s' of '%s'", point.name, package)
            continue
        if isinstance(bound, kind):
            found.setdefault(bound.name, bound)
        else:
            _logger.error("the plug-in '%s' of '%s' is not a '%s'", point.name, package, kind.__name__)
    return found
