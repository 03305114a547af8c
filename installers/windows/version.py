"""Version resource of the Windows programs, in the format of PyInstaller."""

from __future__ import annotations

import re

__all__ = ["COPYRIGHT", "PUBLISHER", "version_numbers", "version_resource"]

PUBLISHER = "The NEP Studio authors"
COPYRIGHT = "MIT License"
_RESOURCE = """\
VSVersionInfo(
    ffi=FixedFileInfo(filevers={numbers}, prodvers={numbers}, OS=0x40004, fileType=0x1),
    kids=[
        StringFileInfo([StringTable("040904B0", [{texts}])]),
        VarFileInfo([VarStruct("Translation", [0x0409, 1200])]),
    ],
)
"""


def version_numbers(version: str) -> tuple[int, int, int, int]:
    """Return a version as the four numbers that Windows requires, such as (1, 2, 3, 0) for "1.2.3rc1".

    Raises ValueError if the version doesn't start with a number.
    """
    match = re.match(r"(\d+)(?:\.(\d+))?(?:\.(\d+))?", version)
    if match is None:
        raise ValueError(f"invalid version '{version}'")
    major, minor, patch = (int(each or 0) for each in match.groups())
    return major, minor, patch, 0


def version_resource(version: str) -> str:
    """Return the text for PyInstaller's ``version=`` file, used by all programs of the package."""
    texts = {
        "CompanyName": PUBLISHER,
        "FileDescription": "NEP Studio",
        "FileVersion": version,
        "LegalCopyright": COPYRIGHT,
        "ProductName": "NEP Studio",
        "ProductVersion": version,
    }
    structs = ", ".join(f"StringStruct({name!r}, {text!r})" for name, text in texts.items())
    return _RESOURCE.format(numbers=version_numbers(version), texts=structs)
