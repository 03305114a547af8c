"""Missing dependencies: Python packages, and system libraries that Qt needs on Linux.

Wheels of PySide6 contain no system libraries, and Python's error message names only the first missing
one. This module imports no packages of the extra ``studio``.
"""

from __future__ import annotations

import ctypes
import importlib.util
import platform
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from app.core.alerts.alerts import Alerts
from nep.i18n import _, format_list, ngettext

ALERT_ID = "system-libraries"
PACKAGES_BY_LIBRARY: Mapping[str, str] = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libXcomposite.so.1": "libxcomposite1",
    "libXdamage.so.1": "libxdamage1",
    "libXext.so.6": "libxext6",
    "libXfixes.so.3": "libxfixes3",
    "libXrandr.so.2": "libxrandr2",
    "libXtst.so.6": "libxtst6",
    "libasound.so.2": "libasound2",
    "libdbus-1.so.3": "libdbus-1-3",
    "libexpat.so.1": "libexpat1",
    "libfontconfig.so.1": "libfontconfig1",
    "libfreetype.so.6": "libfreetype6",
    "libgbm.so.1": "libgbm1",
    "libglib-2.0.so.0": "libglib2.0-0",
    "libgthread-2.0.so.0": "libglib2.0-0",
    "libnspr4.so": "libnspr4",
    "libnss3.so": "libnss3",
    "libnssutil3.so": "libnss3",
    "libsmime3.so": "libnss3",
    "libudev.so.1": "libudev1",
    "libxcb.so.1": "libxcb1",
    "libxcb-dri3.so.0": "libxcb-dri3-0",
    "libxkbcommon.so.0": "libxkbcommon0",
    "libxkbfile.so.1": "libxkbfile1",
    "libz.so.1": "zlib1g",
}
"""Debian and Ubuntu packages by library name; `tools/system_packages.py` installs them.

Libraries that only the X11 plug-in needs, such as libxcb-cursor0, are reported by Qt at startup.
"""
EXTRA_MODULES = (
    "PySide6",
    "cv2",
    "graphlay",
    "jsonpath",
    "jsonschema",
    "mcap",
    "numpy",
    "platformdirs",
    "pyqtgraph",
)
"""Modules that the window needs and that the extra ``studio`` in pyproject.toml installs."""
_RENAMED_PACKAGES = {"libasound2": "libasound2t64", "libglib2.0-0": "libglib2.0-0t64"}
_RENAMED_SINCE = {"debian": 13.0, "ubuntu": 24.04}
_MISSING_LIBRARY = re.compile(r"(\S+\.so[.\d]*): cannot open shared object file")


@dataclass(frozen=True)
class MissingLibraries:
    """Missing system libraries.

    Attributes:
        names: Names of the libraries.
        packages: Packages that contain the libraries, as far as known.
    """

    names: tuple[str, ...]
    packages: tuple[str, ...]

    @property
    def command(self) -> str:
        """Command that installs the packages on Debian and Ubuntu; "" if no package is known."""
        return f"sudo apt install {' '.join(self.packages)}" if self.packages else ""

    @property
    def start_title(self) -> str:
        """Error message for the case that the window can't be opened."""
        template = ngettext(
            "NEP Studio can't start: the system library {names} is missing.",
            "NEP Studio can't start: the system libraries {names} are missing.",
            len(self.names),
        )
        return template.format(names=format_list(self.names))

    @property
    def start_remedy(self) -> str:
        """Instructions for installing the libraries that the window needs."""
        if not self.command:
            return _("Install the packages that contain the missing libraries, then start Studio again.")
        template = _("On Debian and Ubuntu, run “{command}” in a terminal, then start Studio again.")
        return template.format(command=self.command)

    @property
    def title(self) -> str:
        """Error message for the case that the block editor can't be opened."""
        template = ngettext(
            "The block editor can't open: the system library {names} is missing.",
            "The block editor can't open: the system libraries {names} are missing.",
            len(self.names),
        )
        return template.format(names=format_list(self.names))

    @property
    def remedy(self) -> str:
        """Instructions for installing the libraries that the block editor needs."""
        if not self.command:
            return _(
                "Install the packages that contain the missing libraries, then start Studio again. The "
                "Developer layout works without the block editor."
            )
        return _(
            "On Debian and Ubuntu, run “{command}” in a terminal, then start Studio again. The "
            "Developer layout works without the block editor."
        ).format(command=self.command)


def missing_libraries(
    error: ImportError,
    load: Callable[[str], object] = ctypes.CDLL,
    release: Callable[[], Mapping[str, str]] = platform.freedesktop_os_release,
) -> MissingLibraries | None:
    """Return all missing libraries after a failed import; None if the error has another cause.

    Python's error names only one library. The others are found by loading every library that Qt may
    need; if a library can't be loaded because of a missing dependency, the dependency is returned.

    Args:
        error: Error of the failed import.
        load: Loads a library by name; raises OSError.
        release: Returns the fields of os-release.
    """
    library = _library_in(str(error))
    if not library:
        return None
    names = {library: None}
    for name in PACKAGES_BY_LIBRARY:
        try:
            load(name)
        except OSError as failure:
            names[_library_in(str(failure)) or name] = None
    return _missing_libraries(tuple(names), release)


def alert_missing(alerts: Alerts, missing: MissingLibraries) -> None:
    """Raise an alert that the block editor can't be opened, which is also shown on the start page."""
    alerts.raise_alert(ALERT_ID, "error", missing.title, missing.remedy, count=0)


def _library_in(error: str) -> str:
    # From an error of the dynamic linker; "" when it names none.
    match = _MISSING_LIBRARY.search(error)
    return match[1] if match is not None else ""


def import_problem(
    error: ImportError,
    is_installed: Callable[[str], bool] = lambda name: bool(importlib.util.find_spec(name)),
) -> str:
    """Return a sentence about missing packages and how to install them; "" if the error has another cause.

    Args:
        error: Error of the failed import.
        is_installed: Returns True if a module is installed.
    """
    package = (error.name or "").partition(".")[0]
    if isinstance(error, ModuleNotFoundError) and package in EXTRA_MODULES:
        missing = [each for each in EXTRA_MODULES if each == package or not is_installed(each)]
        return _(
            "NEP Studio needs packages that aren't installed ({names}). Install them with “{command}”"
        ).format(names=format_list(missing), command="pip install 'nep-studio[studio]'")
    libraries = missing_libraries(error)
    return f"{libraries.start_title} {libraries.start_remedy}" if libraries is not None else ""


def _missing_libraries(names: tuple[str, ...], release: Callable[[], Mapping[str, str]]) -> MissingLibraries:
    packages = dict.fromkeys(PACKAGES_BY_LIBRARY[name] for name in names if name in PACKAGES_BY_LIBRARY)
    is_renamed = _has_time64_names(release)
    return MissingLibraries(
        names, tuple(_RENAMED_PACKAGES.get(each, each) if is_renamed else each for each in packages)
    )


def _has_time64_names(release: Callable[[], Mapping[str, str]]) -> bool:
    # Debian or Ubuntu with packages renamed for 64-bit times.
    try:
        system = release()
        return float(system.get("VERSION_ID", "0")) >= _RENAMED_SINCE[system.get("ID", "")]
    except (OSError, ValueError, KeyError):
        return False
