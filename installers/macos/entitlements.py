"""Entitlements for the hardened runtime of macOS: the minimum for Studio and Qt WebEngine."""

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
"""URL of Apple's list of entitlements. An entitlement is either true or absent."""
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
"""Names of the hardened runtime's entitlements by key: all that `SOURCE` lists, as of November 2026.

The first six are runtime exceptions, the others resource access; `source_of` returns the page of each.
"""

QT_WEB_PROCESS = frozenset(
    {
        "com.apple.security.cs.allow-jit",
        "com.apple.security.cs.allow-unsigned-executable-memory",
        "com.apple.security.cs.disable-executable-page-protection",
        "com.apple.security.cs.disable-library-validation",
    }
)
"""Entitlements of Qt 6.11.3.

Source: QtWebEngineProcess.app/Contents/Resources/QtWebEngineProcess.entitlements.
"""

WEB_PROCESS: Mapping[str, str] = {
    "com.apple.security.cs.allow-jit": "V8 compiles the block editor's JavaScript",
    "com.apple.security.cs.allow-unsigned-executable-memory": "included in Qt's own entitlements",
    "com.apple.security.cs.disable-executable-page-protection": "without it, pages stay empty on Intel",
}
"""Entitlements of QtWebEngineProcess with the reason for each: Qt's list without one entry.

The exception from library validation is omitted, because all libraries in the package are signed by the
same identity.
"""

STUDIO: Mapping[str, str] = {
    "com.apple.security.cs.allow-jit": "Qt renders web pages in Studio's own process",
    "com.apple.security.cs.allow-unsigned-executable-memory": "importing ctypes creates a callback",
}
"""Entitlements of Studio and the command `nep`.

Callbacks of ctypes and cffi are machine code that libffi generates unless it has prepared trampolines.

Not included are: DYLD variables, because no child process is started with any; library validation,
because all libraries have the same identity; camera and microphone, because Studio uses neither.
Without the latter two keys macOS denies access without asking.
"""


def source_of(key: str) -> str:
    """Return the URL of Apple's page about an entitlement.

    Raises:
        KeyError: The key isn't in `DOCUMENTED`.
    """
    if key not in DOCUMENTED:
        raise KeyError(key)
    return f"{_PAGES}{key}"


def problems(entitlements: Mapping[str, object]) -> list[str]:
    """Return a sentence for each entry that Apple doesn't document or that isn't true."""
    messages = [f"Apple documents no '{key}'" for key in entitlements if key not in DOCUMENTED]
    messages += [
        f"'{key}' must be true or omitted" for key, value in entitlements.items() if value is not True
    ]
    return messages


def write(path: Path, allowed: Mapping[str, str]) -> Path:
    """Write entitlements to a property list for codesign, and return its path.

    Args:
        path: File to write.
        allowed: `STUDIO` or `WEB_PROCESS`.

    Raises:
        ValueError: A key isn't in `DOCUMENTED`.
    """
    content: dict[str, object] = dict.fromkeys(sorted(allowed), True)
    if messages := problems(content):
        raise ValueError("; ".join(messages))
    path.write_bytes(plistlib.dumps(content))
    return path
