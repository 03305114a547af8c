"""Plug-in discovery.

A module of a plug-in package that binds an object of a given name is a plug-in, so that a new file is a new
plug-in. Other distributions can add plug-ins as entry points (`discover`).
"""

from __future__ import annotations

import importlib
import importlib.util
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


_logger = logging.getLogger("nep.system.plugins")


class Plugin(Protocol):
    """Plug-in: an object with a name."""

    @property
    def name(self) -> str:
        """Name of the plug-in."""


T = TypeVar("T", bound=Plugin)


def discover_own(package: str, attribute: str, kind: type[T]) -> Mapping[str, T]:
    """Return the plug-ins of a package by name, without entry points of other distributions.

    Faster than `discover`, because the search for entry points reads all installed packages.

    Args:
        package: Name of the package.
        attribute: Name that each plug-in module binds.
        kind: Required class of the bound object.

    Raises:
        PluginsMissingError: The package has no plug-ins (left out of a frozen program).
        TypeError: A module binds an object of another type.
    """
    plugins: dict[str, T] = {}
    package_module = importlib.import_module(package)
    for info in pkgutil.iter_modules(package_module.__path__, f"{package}."):
        plugin = getattr(importlib.import_module(info.name), attribute, None)
        if plugin is None:
            continue
        if not isinstance(plugin, kind):
            raise TypeError(f"'{info.name}.{attribute}' is not a '{kind.__name__}'")
        plugins[plugin.name] = plugin
    if not plugins:
        raise PluginsMissingError(package, attribute)
    return plugins


def find_own(package: str, name: str, attribute: str, kind: type[T]) -> T | None:
    """Return the plug-in of a package with this name, if its module has the same name; None otherwise.

    Imports no other plug-in.

    Args:
        package: Name of the package.
        name: Name of the plug-in and of its module.
        attribute: Name that the plug-in module binds.
        kind: Required class of the bound object.

    Raises:
        OSError: The module can't be read, for example without a free file descriptor.
    """
    module = f"{package}.{name}"
    if not name.isidentifier() or importlib.util.find_spec(module) is None:
        return None
    plugin = getattr(importlib.import_module(module), attribute, None)
    return plugin if isinstance(plugin, kind) and plugin.name == name else None


def discover(package: str, attribute: str, kind: type[T]) -> Mapping[str, T]:
    """Return the plug-ins of a package by name: objects bound by its modules, and entry points.

    Modules without the attribute are ignored. Entry points of third parties that fail to load are
    logged and ignored; they can't replace plug-ins of the package.

    Args:
        package: Name of the package, and of the entry point group.
        attribute: Name that each plug-in module binds.
        kind: Required class of the bound object.

    Raises:
        PluginsMissingError: The package has no plug-ins (left out of a frozen program).
        TypeError: A module binds an object of another type.
    """
    own = discover_own(package, attribute, kind)
    return {**installed_plugins(package, kind), **own}


def installed_plugins(group: str, kind: type[T]) -> Mapping[str, T]:
    """Return the plug-ins of other distributions by name: objects of an entry point group.

    Entry points that fail to load are logged and ignored.

    Args:
        group: Name of the entry point group.
        kind: Required class of the objects.
    """
    plugins: dict[str, T] = {}
    for point in metadata.entry_points(group=group):
        try:
            plugin = point.load()
        except (Exception, SystemExit):
            _logger.exception("can't load the plug-in '%s' of '%s'", point.name, group)
            continue
        if isinstance(plugin, kind):
            plugins.setdefault(plugin.name, plugin)
        else:
            _logger.error("the plug-in '%s' of '%s' is not a '%s'", point.name, group, kind.__name__)
    return plugins
