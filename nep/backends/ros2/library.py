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

from nep.backends.bases.optional_library import OptionalLibrary
from nep.i18n import _
from nep.system.forks import call_in_child

_MODULE_NAMES = ("core", "domain", "idl", "pub", "sub", "topic", "qos", "builtin")
_MACHINES_WITH_WHEELS = frozenset({"x86_64", "amd64"})
_FD_FOLDER = "/proc/self/fd"
_FIRST_PORT, _PORTS_PER_DOMAIN = 7400, 250
"""Base port of domain 0, and number of ports per domain, as the DDS wire protocol (RTPS) specifies."""


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


def _install_hint() -> str:
    if sys.platform != "darwin" and platform.machine().lower() not in _MACHINES_WITH_WHEELS:
        return _(
            "Cyclone DDS has no wheel for '{machine}'; build 'cyclonedds' 11 on this computer and "
            "install 'rosbags'"
        ).format(machine=platform.machine())
    return _("install it with 'pip install nep-studio[ros2]'")


_library = OptionalLibrary("ros2", _install_hint)


def load_dds(load: Callable[[str], ModuleType] = importlib.import_module) -> Dds:
    """Load and return the modules of Cyclone DDS.

    Raises:
        BackendUnavailableError: cyclonedds is not installed or can't be loaded.
        NepError: The process was forked from one that uses cyclonedds.
    """
    return _library.load(lambda: Dds(*(load(f"cyclonedds.{part}") for part in _MODULE_NAMES)))


def load_typesys(load: Callable[[str], ModuleType] = importlib.import_module) -> Any:  # noqa: ANN401 - see `Dds`
    """Load and return `rosbags.typesys`. Raises `BackendUnavailableError` if rosbags is not installed."""
    return _library.load(lambda: load("rosbags.typesys"))


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
    return _library.has_forked


def _forked() -> None:
    # In a forked child no entity may be deleted, not even at exit: that would block.
    core = sys.modules.get("cyclonedds.core")
    if core is None:
        return
    _library.has_forked = True
    # keeps the finalizers from deleting anything
    for entity in list(core.Entity._entities.values()):  # noqa: SLF001
        if isinstance(entity, core.WaitSet):
            entity.attached.clear()
    core.Entity._entities.clear()  # noqa: SLF001


call_in_child(_forked)
