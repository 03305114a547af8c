"""What the hardened runtime of macOS must allow: as little as Studio and Qt WebEngine need."""

from __future__ import annotations

import plistlib
from collections.abc import Mapping
from pathlib import Path

__all__ = [
    "DOCUMENTED",
    "QT_WEB_PROCESS",
    "SOURCE",
    "STUDIO",
    "WEB_PROCESS",
    "problems",
    "source_of",
    "write",
]

SOURCE = "https://developer.apple.com/documentation/security/hardened-runtime"
"""The list of all of them. It says, too, that a key which is not true is to be left out."""
_PAGES = "https://developer.apple.com/documentation/bundleresources/entitlements/"
DOCUMENTED: Mapping[str, str] = {
    "com.apple.security.cs.allow-jit": "Allow execution of JIT-compiled code",
    "com.apple.security.cs.allow-unsigned-executable-memory": "Allow unsigned executable memory",
    "com.apple.security.cs.allow-dyld-environment-variables": "Allow DYLD environment variables",
    "com.apple.security.cs.disable-library-validation": "Disable library validation",
    "com.apple.security.cs.disable-executable-page-protection": "Disable executable memory protection",
    "com.apple.security.cs.debugger": "Debugging tool",
    "com.apple.security.device.audio-input": "Audio input",
    "com.apple.security.device.camera": "Camera",
    "com.apple.security.personal-information.location": "Location",
    "com.apple.security.personal-information.addressbook": "Address book",
    "com.apple.security.personal-information.calendars": "Calendars",
    "com.apple.security.personal-information.photos-library": "Photos library",
    "com.apple.security.automation.apple-events": "Apple events",
}
"""The keys of the hardened runtime with their names: all that `SOURCE` lists, compared in November 2026.

The first six are its runtime exceptions, the others its access to resources; `source_of` has each one's page.
"""

QT_WEB_PROCESS = frozenset(
    {
        "com.apple.security.cs.allow-jit",
        "com.apple.security.cs.allow-unsigned-executable-memory",
        "com.apple.security.cs.disable-executable-page-protection",
        "com.apple.security.cs.disable-library-validation",
    }
)
"""What Qt 6.11.3 itself ships: QtWebEngineProcess.app/Contents/Resources/QtWebEngineProcess.entitlements."""

WEB_PROCESS: Mapping[str, str] = {
    "com.apple.security.cs.allow-jit": "V8 compiles the block editor's JavaScript",
    "com.apple.security.cs.allow-unsigned-executable-memory": "Qt's own list has it",
    "com.apple.security.cs.disable-executable-page-protection": "without it pages stay empty on Intel",
}
"""QtWebEngineProcess, with the reason for each: Qt's list, but for libraries of strangers.

All libraries in the package are signed with the same name, so none of them is a stranger.
"""

STUDIO: Mapping[str, str] = {
    "com.apple.security.cs.allow-jit": "Qt draws web pages in Studio's own process",
    "com.apple.security.cs.allow-unsigned-executable-memory": "importing ctypes makes a callback",
}
"""Studio and the command `nep`.

Callbacks of ctypes and cffi are machine code that libffi writes, where it has none prepared. Not in it: DYLD
variables, as no child process is started with any; libraries of strangers, as all are signed with one name;
camera and microphone, as Studio uses neither: without their keys macOS refuses them unasked.
"""


def source_of(key: str) -> str:
    """Where Apple says what a key of `DOCUMENTED` does. KeyError when it is none."""
    if key not in DOCUMENTED:
        raise KeyError(key)
    return f"{_PAGES}{key}"


def problems(entitlements: Mapping[str, object]) -> list[str]:
    """A sentence for each entry that Apple does not document, or that is not simply true."""
    found = [f"Apple documents no '{key}'" for key in entitlements if key not in DOCUMENTED]
    found += [f"'{key}' must be true or left out" for key, value in entitlements.items() if value is not True]
    return found


def write(path: Path, allowed: Mapping[str, str]) -> Path:
    """Write `STUDIO` or `WEB_PROCESS` as codesign reads it. ValueError for a key that Apple does not tell."""
    content: dict[str, object] = dict.fromkeys(sorted(allowed), True)
    if wrong := problems(content):
        raise ValueError("; ".join(wrong))
    path.write_bytes(plistlib.dumps(content))
    return path
