"""Draw without the graphics driver where there is no graphics processor, and the driver is a program, too.

Qt has a graphics driver compose a window once it shows a web page, on every change all of it. Without a
processor of its own the driver (llvmpipe on Linux, WARP on Windows) is slow: it took a third of a core for
pictures 25 times a second. Qt's own drawing takes nothing beyond the window's.
"""

from __future__ import annotations

import ctypes
import glob
import sys
from collections.abc import Callable, MutableMapping, Sequence

CHOICE, BY_SOFTWARE = "QT_QUICK_BACKEND", "software"
DEVICES = ("/dev/dri/renderD*", "/dev/nvidia[0-9]*", "/dev/dxg", "/dev/mali*", "/dev/kgsl*", "/dev/pvr*")
"""What a graphics processor is asked through on Linux, also in Windows' subsystem and on small boards."""
BASIC = ("Microsoft Basic Display", "Microsoft Basic Render")
"""How Windows calls what stands in for a graphics driver."""
_ATTACHED = 0x1


def draw_by_software(
    environ: MutableMapping[str, str], platform: str, there: Callable[[str], bool] | None = None
) -> bool:
    """Let Qt draw by itself when there is no graphics processor; whether it does.

    A person's own choice in the environment stays. Called before Qt is used. ``there`` tells of a platform
    whether it has one.
    """
    if not environ.get(CHOICE) and not (there or has_graphics_processor)(platform):
        environ[CHOICE] = BY_SOFTWARE
    return environ.get(CHOICE) == BY_SOFTWARE


def has_graphics_processor(platform: str) -> bool:
    """Whether this computer has one, as far as the system tells; where it tells nothing it has."""
    if platform.startswith("linux"):
        return any(glob.glob(pattern) for pattern in DEVICES)  # noqa: PTH207 - of no folder of ours
    if platform == "win32":
        return has_driver(adapters())
    return True


def has_driver(names: Sequence[str]) -> bool:
    """Whether any of these adapters is more than Windows' stand-in; none at all tells nothing."""
    return not names or any(not name.startswith(BASIC) for name in names)


def adapters() -> list[str]:
    """How Windows calls the graphics adapters that show something; none elsewhere."""
    found: list[str] = []
    if sys.platform == "win32":

        class Device(ctypes.Structure):
            _fields_ = (
                ("size", ctypes.c_uint32),
                ("name", ctypes.c_wchar * 32),
                ("words", ctypes.c_wchar * 128),
                ("state", ctypes.c_uint32),
                ("id", ctypes.c_wchar * 128),
                ("key", ctypes.c_wchar * 128),
            )

        device, number = Device(), 0
        device.size = ctypes.sizeof(device)
        while ctypes.windll.user32.EnumDisplayDevicesW(None, number, ctypes.byref(device), 0):
            number += 1
            if device.state & _ATTACHED:
                found.append(device.words)
    return found
