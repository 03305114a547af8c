"""What Windows tells about the programs: their version resource, as PyInstaller reads it."""

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
    """A version as Windows counts: four numbers, of which "1.2.3rc1" gives 1, 2, 3 and 0."""
    found = re.match(r"(\d+)(?:\.(\d+))?(?:\.(\d+))?", version)
    if found is None:
        raise ValueError(f"no version: '{version}'")
    major, minor, patch = (int(each or 0) for each in found.groups())
    return major, minor, patch, 0


def version_resource(version: str) -> str:
    """The text of the file that PyInstaller's ``version=`` asks for, for all programs of the package."""
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
