"""Icon files for Studio's programs and documents on Windows, with all sizes in one file."""

from __future__ import annotations

import struct
from pathlib import Path

__all__ = ["SIDES", "ico", "write_icon"]

SIDES = (16, 24, 32, 48, 64, 128, 256)


def ico(pictures: dict[int, bytes]) -> bytes:
    """Return an .ico file from square PNG images by their size in pixels (at most 256)."""
    header = struct.pack("<HHH", 0, 1, len(pictures))
    offset = len(header) + 16 * len(pictures)
    entries = b""
    for side, png in sorted(pictures.items()):
        entries += struct.pack("<BBBBHHII", side % 256, side % 256, 0, 0, 1, 32, len(png), offset)
        offset += len(png)
    return header + entries + b"".join(png for _side, png in sorted(pictures.items()))


def write_icon(painted: Path, name: str, target: Path) -> Path:
    """Combine images into an .ico file and return its path.

    Args:
        painted: Folder of the images in all `SIDES` (`installers.icon_files`).
        name: Name of the images without the size.
        target: Path of the .ico file.
    """
    target.write_bytes(ico({side: (painted / f"{name}-{side}.png").read_bytes() for side in SIDES}))
    return target
