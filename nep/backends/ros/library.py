"""Access to rospy, which is loaded with the first node, even in a venv next to Debian's Python.

rospy isn't on PyPI, and a venv doesn't search the folder of Debian's packages. A finder at the end of
`sys.meta_path` searches that folder, but only for ROS and its dependencies. No other system package,
such as numpy, is imported from there, and packages of the venv take precedence.
"""

from __future__ import annotations

import atexit
import importlib
import importlib.machinery
import importlib.util
import logging
import sys
import warnings
from collections.abc import Callable, Sequence
from importlib.abc import MetaPathFinder
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from nep.backends.bases.optional_library import OptionalLibrary
from nep.i18n import _
from nep.system.forks import call_in_child

SEARCH_FOLDERS = ("/opt/ros/noetic/lib/python3/dist-packages", "/usr/lib/python3/dist-packages")
_MODULE_NAMES = frozenset({
    "rospy", "rosgraph", "roslib", "rospkg", "roscpp", "genpy", "genmsg", "catkin", "catkin_pkg",
    "yaml", "_yaml", "defusedxml", "netifaces", "distro", "dateutil", "docutils", "pyparsing", "six",
})  # fmt: skip
_PACKAGE_SUFFIXES = ("_msgs", "_srvs")
_DEPRECATED_MODULES = r"(rospy|rosgraph|roslib|rospkg|genpy|genmsg|catkin_pkg)(\..*)?"
_library = OptionalLibrary(
    "ros", lambda: _("install it with 'sudo apt install python3-rospy python3-std-msgs python3-sensor-msgs'")
)


class RosFinder(MetaPathFinder):
    """Import finder that searches system folders, but only for ROS packages.

    Args:
        folders: Folders to search.
    """

    def __init__(self, folders: Sequence[str]) -> None:
        self._folders = list(folders)
        self.extra_names: set[str] = set()

    def find_spec(
        self,
        name: str,
        path: Sequence[str] | None,
        target: ModuleType | None = None,  # noqa: ARG002 - signature of the base class
    ) -> importlib.machinery.ModuleSpec | None:
        """Find a top-level package of ROS; return None for all other modules.

        Python finds submodules through their package.
        """
        if path is not None or not (
            name in _MODULE_NAMES or name in self.extra_names or name.endswith(_PACKAGE_SUFFIXES)
        ):
            return None
        return importlib.machinery.PathFinder.find_spec(name, self._folders)


_finder = RosFinder([folder for folder in SEARCH_FOLDERS if Path(folder).is_dir()])


def _forked() -> None:
    # In a forked child rospy's threads don't exist, and it can be started only once per process.
    core = sys.modules.get("rospy.core")
    if core is None or not core.is_initialized():
        return
    _library.has_forked = True
    exit_handler = getattr(core, "_ros_atexit", None)
    if exit_handler is not None:
        atexit.unregister(exit_handler)  # it would unregister the parent's publishers and subscribers
    topics = sys.modules["rospy.impl.registration"].get_topic_manager()
    for impl in [*topics.pubs.values(), *topics.subs.values()]:
        for connection in impl.connections:
            if connection.socket is not None:
                connection.socket.close()


call_in_child(_forked)


def get_rospy() -> Any:  # noqa: ANN401 - not typed
    """Load and return rospy.

    Raises:
        BackendUnavailableError: rospy is not installed.
        NepError: The process was forked from one that uses rospy.
    """
    return load_rospy() if _library.has_forked else sys.modules.get("rospy") or load_rospy()


def load_rospy(load: Callable[[str], ModuleType] = importlib.import_module) -> ModuleType:
    """Import rospy and undo the side effects of the import on the program.

    Raises the same errors as `get_rospy`.
    """
    if _finder not in sys.meta_path:
        sys.meta_path.append(_finder)
    logger_class = logging.getLoggerClass()

    def import_modules() -> ModuleType:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            load("std_msgs.msg")
            return load("rospy")

    try:
        module = _library.load(import_modules)
    finally:
        logging.setLoggerClass(logger_class)  # rospy replaces the logger class for the whole program
    warnings.filterwarnings("ignore", category=DeprecationWarning, module=_DEPRECATED_MODULES)
    return module


class ServiceDefinition(NamedTuple):
    """Definitions of a service's request and response, and their common MD5 sum."""

    request: str
    response: str
    md5sum: str


def message_definition(name: str) -> tuple[str, str] | None:
    """Return the definition and MD5 sum of a message type, or None if it is not installed."""
    message_class = _installed_class(name, "msg")
    text, checksum = getattr(message_class, "_full_text", None), getattr(message_class, "_md5sum", None)
    return (text, checksum) if isinstance(text, str) and isinstance(checksum, str) else None


def service_definition(name: str) -> ServiceDefinition | None:
    """Return the definition of a service type such as "std_srvs/SetBool"; None if it is not installed."""
    service_class = _installed_class(name, "srv")
    request, response = (
        getattr(getattr(service_class, each, None), "_full_text", None)
        for each in ("_request_class", "_response_class")
    )
    md5sum = getattr(service_class, "_md5sum", None)
    if isinstance(request, str) and isinstance(response, str) and isinstance(md5sum, str):
        return ServiceDefinition(request, response, md5sum)
    return None


def _installed_class(name: str, folder: str) -> object:
    package, _slash, kind = name.partition("/")
    if not package.isidentifier() or not kind.isidentifier():
        return None
    get_rospy()
    if not _has_folder(package, folder):
        return None  # importing runs code, and the name may be untrusted
    try:
        return getattr(importlib.import_module(f"{package}.{folder}"), kind, None)
    except ImportError:
        return None


def _has_folder(package: str, folder: str) -> bool:
    # Checks for files, without importing the package.
    if any(Path(location, package, folder, "__init__.py").is_file() for location in SEARCH_FOLDERS):
        _finder.extra_names.add(package)
        return True
    try:
        spec = importlib.util.find_spec(package)
    except (ImportError, ValueError):
        return False
    locations = () if spec is None else spec.submodule_search_locations or ()
    return any(Path(location, folder, "__init__.py").is_file() for location in locations)
