"""Selection of Qt's software renderer on machines without a GPU.

Once a window shows a web page, Qt composes the whole window with the graphics driver at every change.
Without a GPU the driver renders in software too (llvmpipe on Linux, WARP on Windows) and is slow: it
used a third of a core for images at 25 Hz. Qt's own software renderer adds almost no load.
"""

from __future__ import annotations

import ctypes
import glob
import sys
from collections.abc import Callable, MutableMapping, Sequence

BACKEND_VARIABLE, SOFTWARE_BACKEND = "QT_QUICK_BACKEND", "software"
GPU_DEVICE_PATTERNS = (
    "/dev/dri/renderD*",
    "/dev/nvidia[0-9]*",
    "/dev/dxg",
    "/dev/mali*",
    "/dev/kgsl*",
    "/dev/pvr*",
)
"""Patterns for the device files of GPUs on Linux, including WSL and single-board computers."""
FALLBACK_ADAPTERS = ("Microsoft Basic Display", "Microsoft Basic Render")
"""Prefixes of the names of Windows' fallback graphics adapters."""
_ATTACHED_TO_DESKTOP = 0x1


def use_software_renderer(
    environ: MutableMapping[str, str], platform: str, has_gpu: Callable[[str], bool] | None = None
) -> bool:
    """Select Qt's software renderer on a machine without a GPU; call this before Qt is used.

    Args:
        environ: Environment variables, modified in place. A renderer that is already set isn't changed.
        platform: Value of `sys.platform`.
        has_gpu: Returns True if there is a GPU, given the platform; default: `has_graphics_processor`.

    Returns:
        True if the software renderer is selected.
    """
    if not environ.get(BACKEND_VARIABLE) and not (has_gpu or has_graphics_processor)(platform):
        environ[BACKEND_VARIABLE] = SOFTWARE_BACKEND
    return environ.get(BACKEND_VARIABLE) == SOFTWARE_BACKEND


def has_graphics_processor(platform: str) -> bool:
    """Return True if this computer has a GPU, or if that can't be determined on the platform."""
    if platform.startswith("linux"):
        return any(glob.glob(pattern) for pattern in GPU_DEVICE_PATTERNS)  # noqa: PTH207 - absolute patterns
    if platform == "win32":
        return has_driver(adapters())
    return True


def has_driver(names: Sequence[str]) -> bool:
    """Return True if one of the adapters is not a fallback adapter of Windows, or if none is listed."""
    return not names or any(not name.startswith(FALLBACK_ADAPTERS) for name in names)


def adapters() -> list[str]:
    """Return the names of the active graphics adapters; empty except on Windows."""
    names: list[str] = []
    if sys.platform == "win32":

        class Device(ctypes.Structure):
            _fields_ = (
                ("size", ctypes.c_uint32),
                ("name", ctypes.c_wchar * 32),
                ("description", ctypes.c_wchar * 128),
                ("state", ctypes.c_uint32),
                ("id", ctypes.c_wchar * 128),
                ("key", ctypes.c_wchar * 128),
            )

        device, index = Device(), 0
        device.size = ctypes.sizeof(device)
        while ctypes.windll.user32.EnumDisplayDevicesW(None, index, ctypes.byref(device), 0):
            index += 1
            if device.state & _ATTACHED_TO_DESKTOP:
                names.append(device.description)
    return names
