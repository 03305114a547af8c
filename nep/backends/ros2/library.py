"""Access to cyclonedds and rosbags, which are loaded with the first node and can't be used after a fork."""

from __future__ import annotations

import importlib
import os
import platform
import socket
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from nep.errors import BackendUnavailableError, NepError
from nep.i18n import _
from nep.system.forks import call_in_child

_MODULE_NAMES = ("core", "domain", "idl", "pub", "sub", "topic", "qos", "builtin")
_MACHINES_WITH_WHEELS = frozenset({"x86_64", "amd64"})
_FD_FOLDER = "/proc/self/fd"
_FIRST_PORT, _PORTS_PER_DOMAIN = 7400, 250
"""Base port of domain 0, and number of ports per domain, as the DDS wire protocol (RTPS) specifies."""
_inherited_libraries: set[str] = set()
"""Names of libraries that were in use in the parent process before a fork.

They can't be used in the child process, because their threads don't exist there.
"""


class Dds(NamedTuple):
    """Modules of cyclonedds, which have no type annotations."""

    core: Any
    domain: Any
    idl: Any
    pub: Any
    sub: Any
    topic: Any
    qos: Any
    builtin: Any


def load_dds(load: Callable[[str], ModuleType] = importlib.import_module) -> Dds:
    """Load and return the modules of Cyclone DDS.

    Raises:
        BackendUnavailableError: cyclonedds is not installed or can't be loaded.
        NepError: The process was forked from one that uses cyclonedds.
    """
    if _inherited_libraries:
        raise NepError(
            _(
                "'ros2' doesn't work in a process forked from a program that uses it; start the process "
                "with multiprocessing's start method 'spawn'"
            )
        )
    try:
        return Dds(*(load(f"cyclonedds.{part}") for part in _MODULE_NAMES))
    except Exception as error:  # its loader raises its own exception class
        raise _unavailable_error() from error


def load_typesys(load: Callable[[str], ModuleType] = importlib.import_module) -> Any:  # noqa: ANN401 - see `Dds`
    """Load and return `rosbags.typesys`. Raises `BackendUnavailableError` if rosbags is not installed."""
    try:
        return load("rosbags.typesys")
    except (ImportError, OSError) as error:
        raise _unavailable_error() from error


def _unavailable_error() -> BackendUnavailableError:
    if sys.platform != "darwin" and platform.machine().lower() not in _MACHINES_WITH_WHEELS:
        needs = _(
            "Cyclone DDS has no wheel for '{machine}'; build 'cyclonedds' 11 on this computer and "
            "install 'rosbags'"
        )
        return BackendUnavailableError("ros2", needs.format(machine=platform.machine()))
    return BackendUnavailableError("ros2", _("install it with 'pip install nep-studio[ros2]'"))


def restrict_to_loopback(domain: int) -> None:
    """Restrict the receiving sockets of a domain to the loopback interface. Linux only.

    Needed because Cyclone DDS always binds its sockets to all addresses.
    """
    if not sys.platform.startswith("linux"):
        return
    first_port = _FIRST_PORT + _PORTS_PER_DOMAIN * domain
    for path in Path(_FD_FOLDER).iterdir():
        try:
            if not path.is_socket():
                continue
            with socket.socket(fileno=os.dup(int(path.name))) as duplicate:
                host, port = duplicate.getsockname()[:2]
                if host == "0.0.0.0" and port in range(first_port, first_port + _PORTS_PER_DOMAIN):  # noqa: S104
                    duplicate.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, b"lo\0")
        except (
            OSError,
            ValueError,
            TypeError,
        ):  # closed, another kind of descriptor, or not permitted by an old kernel
            continue


def has_forked() -> bool:
    """Return True in a forked child process, where DDS must not be used."""
    return bool(_inherited_libraries)


def _forked() -> None:
    # In a forked child no entity may be deleted, not even at exit: that would block.
    core = sys.modules.get("cyclonedds.core")
    if core is None:
        return
    _inherited_libraries.add("cyclonedds")
    # keeps the finalizers from deleting anything
    for entity in list(core.Entity._entities.values()):  # noqa: SLF001
        if isinstance(entity, core.WaitSet):
            entity.attached.clear()
    core.Entity._entities.clear()  # noqa: SLF001


call_in_child(_forked)
