"""System libraries that a frozen program requires, and the Debian packages that contain them.

The build fails for an unlisted library, because it would be missing on a user's computer. The package
names are valid for Debian and Ubuntu; "a|b" means one package that has different names in different
releases.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path

from installers.context import PackageError

__all__ = ["libc_needed", "system_packages"]

_GLIB = "libglib2.0-0t64|libglib2.0-0"
PACKAGES = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libX11-xcb.so.1": "libx11-xcb1",
    "libX11.so.6": "libx11-6",
    "libXext.so.6": "libxext6",
    "libXfixes.so.3": "libxfixes3",
    "libXrender.so.1": "libxrender1",
    "libasound.so.2": "libasound2t64|libasound2",
    "libcups.so.2": "libcups2t64|libcups2",
    "libdbus-1.so.3": "libdbus-1-3",
    "libdrm.so.2": "libdrm2",
    "libexpat.so.1": "libexpat1",
    "libfontconfig.so.1": "libfontconfig1",
    "libfreetype.so.6": "libfreetype6",
    "libgbm.so.1": "libgbm1",
    "libgcc_s.so.1": "libgcc-s1",
    "libgio-2.0.so.0": _GLIB,
    "libglib-2.0.so.0": _GLIB,
    "libgobject-2.0.so.0": _GLIB,
    "libgthread-2.0.so.0": _GLIB,
    "libpulse.so.0": "libpulse0",
    "libspeechd.so.2": "libspeechd2",
    "libstdc++.so.6": "libstdc++6",
    "libudev.so.1": "libudev1",
    "libuuid.so.1": "libuuid1",
    "libwayland-client.so.0": "libwayland-client0",
    "libwayland-cursor.so.0": "libwayland-cursor0",
    "libwayland-egl.so.1": "libwayland-egl1",
    "libxcb-dri3.so.0": "libxcb-dri3-0",
    "libxcb.so.1": "libxcb1",
}
ALWAYS_REQUIRED = ("xkb-data",)
"""Required packages that no library is linked with: keyboard layouts for libxkbcommon."""
_LIBC_LIBRARY = re.compile(r"(?:ld-linux-|lib(?:c|dl|m|pthread|resolv|rt|util)\.so\.)")
_NEEDED = re.compile(r"\(NEEDED\)\s+Shared library: \[([^\]]+)\]")
_GLIBC = re.compile(rb"GLIBC_(\d+)\.(\d+)\b")


def system_packages(folder: Path) -> tuple[Sequence[str], Sequence[str]]:
    """Return the packages that a frozen program requires, and the packages that only Qt plug-ins require.

    Without the packages for plug-ins Studio runs, but can't print or speak.

    Raises:
        PackageError: A library isn't in `PACKAGES`.
    """
    included = {path.name for path in folder.rglob("*") if path.is_file()}
    needed, optional = set[str](), set[str]()
    for path in _binaries(folder):
        for name in _NEEDED.findall(_readelf(path)):
            if name not in included and not _LIBC_LIBRARY.match(name):
                if name not in PACKAGES:
                    raise PackageError(f"'{path.name}' needs '{name}': add it to PACKAGES or bundle it")
                (optional if "plugins" in path.parts else needed).add(PACKAGES[name])
    return sorted({*needed, *ALWAYS_REQUIRED}), sorted(optional - needed)


def libc_needed(folder: Path) -> str:
    """Return the newest glibc version that a binary in a folder requires, by default "2.28"."""
    versions = {
        (int(major), int(minor))
        for path in _binaries(folder)
        for major, minor in _GLIBC.findall(path.read_bytes())
    }
    return "{}.{}".format(*max(versions)) if versions else "2.28"


def _readelf(path: Path) -> str:
    command = ["readelf", "--dynamic", "--wide", str(path)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def _binaries(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not path.is_symlink():
            with path.open("rb") as file:
                if file.read(4) == b"\x7fELF":
                    yield path
