"""The libraries cyclonedds and rosbags: found when the first node asks; told of forks, kept to loopback."""

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
from nep.system.forks import in_child

__all__ = ["Dds", "dds", "has_forked", "keep_to_loopback", "typesys"]

_PARTS = ("core", "domain", "idl", "pub", "sub", "topic", "qos", "builtin")
_MACHINES_WITH_WHEELS = frozenset({"x86_64", "amd64"})
_DESCRIPTORS = "/proc/self/fd"
_PORTS, _PORTS_OF_A_DOMAIN = 7400, 250
"""Where the ports of domain 0 begin, and how many each has, as DDS's wire protocol says."""
_inherited: set[str] = set()
"""Whether this is a child that was forked: the threads of Cyclone DDS stayed behind."""


class Dds(NamedTuple):
    """The modules of cyclonedds; it is not typed."""

    core: Any
    domain: Any
    idl: Any
    pub: Any
    sub: Any
    topic: Any
    qos: Any
    builtin: Any


def dds(load: Callable[[str], ModuleType] = importlib.import_module) -> Dds:
    """Cyclone DDS. Raises `BackendUnavailableError` where it is not installed or its library does not load.

    Raises `NepError` in a child that was forked from a program that uses it.
    """
    if _inherited:
        raise NepError(
            _(
                "'ros2' does not work in a program that was forked from one that uses it; start it anew, "
                "with multiprocessing by the method 'spawn'"
            )
        )
    try:
        return Dds(*(load(f"cyclonedds.{part}") for part in _PARTS))
    except Exception as error:  # its loader raises a class of its own
        raise _unavailable() from error


def typesys(load: Callable[[str], ModuleType] = importlib.import_module) -> Any:  # noqa: ANN401 - see `Dds`
    """`rosbags.typesys`. Raises `BackendUnavailableError` where it is not installed."""
    try:
        return load("rosbags.typesys")
    except (ImportError, OSError) as error:
        raise _unavailable() from error


def _unavailable() -> BackendUnavailableError:
    if sys.platform != "darwin" and platform.machine().lower() not in _MACHINES_WITH_WHEELS:
        needs = _(
            "Cyclone DDS has no wheel for '{machine}'; build 'cyclonedds' 11 there, and install 'rosbags'"
        )
        return BackendUnavailableError("ros2", needs.format(machine=platform.machine()))
    return BackendUnavailableError("ros2", _("install it with 'pip install nep-studio[ros2]'"))


def keep_to_loopback(domain: int) -> None:
    """Let this process's sockets of a domain hear loopback alone, where the system can do that (Linux).

    Cyclone DDS binds what it hears with to every address, whatever it is told.
    """
    if not sys.platform.startswith("linux"):
        return
    first = _PORTS + _PORTS_OF_A_DOMAIN * domain
    for each in Path(_DESCRIPTORS).iterdir():
        try:
            if not each.is_socket():
                continue
            with socket.socket(fileno=os.dup(int(each.name))) as copy:
                host, port = copy.getsockname()[:2]
                if host == "0.0.0.0" and port in range(first, first + _PORTS_OF_A_DOMAIN):  # noqa: S104
                    copy.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, b"lo\0")
        except (
            OSError,
            ValueError,
            TypeError,
        ):  # gone, of another kind, or an old kernel forbids it
            continue


def has_forked() -> bool:
    """Whether nothing of DDS may be touched here."""
    return bool(_inherited)


def _forked() -> None:
    """In a child: nothing of DDS may be deleted, not even when the interpreter ends: that would wait."""
    core = sys.modules.get("cyclonedds.core")
    if core is None:
        return
    _inherited.add("cyclonedds")
    for entity in list(core.Entity._entities.values()):  # noqa: SLF001 - what is not there is not deleted
        if isinstance(entity, core.WaitSet):
            entity.attached.clear()
    core.Entity._entities.clear()  # noqa: SLF001


in_child(_forked)
