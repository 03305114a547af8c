"""Id of this computer. Programs with the same id share a system clock."""

from __future__ import annotations

import ctypes
import platform
import sys
from collections.abc import Callable, Mapping
from functools import cache
from hashlib import sha256
from importlib import import_module
from pathlib import Path

_BOOT_ID_FILE = Path("/proc/sys/kernel/random/boot_id")


@cache
def computer_id() -> str:
    """Return 16 hexadecimal digits that identify the running system, or "" if unknown.

    Containers on one computer have the same id, because they share its clock; a virtual machine has a
    different one. The digits are a hash, so that the system's identifier is not published.
    """
    identifier = system_identifier()
    return sha256(f"nep clock {identifier}".encode("utf-8", "replace")).hexdigest()[:16] if identifier else ""


def system_identifier() -> str:
    """Return the system's own identifier (boot id, boot session or machine GUID), or "" if unknown."""
    query = _IDENTIFIER_QUERIES.get(sys.platform)
    try:
        return "" if query is None else query()
    except (OSError, ValueError, AttributeError):
        return ""


def _boot_id() -> str:
    # Linux: new at each boot, the same in all containers.
    return _BOOT_ID_FILE.read_text("ascii").strip()


def _boot_session() -> str:
    # macOS: new at each boot.
    buffer, size = ctypes.create_string_buffer(64), ctypes.c_size_t(64)
    sysctl = ctypes.CDLL(None).sysctlbyname
    error_code = sysctl(b"kern.bootsessionuuid", buffer, ctypes.byref(size), None, ctypes.c_size_t(0))
    return "" if error_code else buffer.value.decode("ascii")


def _machine_guid() -> str:
    # Windows: constant; copies of a machine differ by their names.
    winreg = import_module("winreg")
    with winreg.OpenKey(winreg.HKEY_LOCAL_MACHINE, r"SOFTWARE\Microsoft\Cryptography") as key:
        return f"{winreg.QueryValueEx(key, 'MachineGuid')[0]} {platform.node()}"


_IDENTIFIER_QUERIES: Mapping[str, Callable[[], str]] = {
    "linux": _boot_id,
    "darwin": _boot_session,
    "win32": _machine_guid,
}
